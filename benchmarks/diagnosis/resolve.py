"""Run the experiment that the diagnosis suggests, on the machine itself, and diagnose again with it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from case import Case
from experiment import Experiment, record_of
from score import rungs, score


def resolved(case: Case, data: Experiment, ladder: Any, level: float, suite: int) -> dict[str, Any]:
    """Whether the suggested experiment settles what the first data could not show.

    Parameters
    ----------
    case : Case
    data : Experiment
        The first recordings.
    ladder : Ladder
        What they led to.
    level : float
    suite : int

    Returns
    -------
    dict
        ``resolved``, and ``resolution``: the signal, the verdict and what was added.
    """
    from idloop.diagnose import refine
    from idloop.signals import build_signal

    suggestion = ladder.suggested_experiment
    if suggestion is None:
        return {"resolved": False, "resolution": {"signal": None}}
    signal = build_signal(**suggestion["signal"])
    runs_in = case
    truth = data.truth
    if suggestion["adds_to"] == "command" and case.loop == "closed":
        runs_in, truth = replace(case, loop="open"), replace(truth, controller=None)
    value = np.asarray(signal.value) + (float(suggestion.get("start", 0.0)) if runs_in.loop == "closed" else 0.0)
    record = record_of(runs_in, truth, value, signal.rate, suite, "suggested")
    again = refine(data.start, (*data.training, record), data.validation, level=level, seed=suite)
    result = score(case, data.start, rungs(again))
    return {
        "resolved": bool(all(result.found) and not result.false),
        "resolution": {
            "signal": dict(suggestion["signal"]),
            "adds_to": suggestion["adds_to"],
            "verdict": again.verdict,
            "added": [list(rung.set) for rung in rungs(again)],
            "exact": result.exact,
        },
    }
