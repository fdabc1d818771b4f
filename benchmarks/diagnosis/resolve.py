"""Run the experiment that the diagnosis suggests, on the machine itself, and diagnose again with it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from case import Case
from experiment import Experiment, record_of
from score import rungs, score

# The next experiment may go so much further than the first: command, speed, travel; at least so many turns.
_COMMAND, _SPEED, _TRAVEL, _TURNS = 3.0, 4.0, 3.0, 1.5


def _limits(data: Experiment) -> Any:
    """What the machine allows, as a user would state it."""
    from idloop.diagnosis.design.limits import Limits, motion

    motions = [motion(data.start, record) for record in data.training]
    travel = _TRAVEL * max(float(np.ptp(place)) for place, _ in motions)
    if data.start.units.position == "rad":
        travel = max(travel, 2.0 * np.pi * _TURNS)
    return Limits(
        command=_COMMAND * max(float(np.max(np.abs(record.input))) for record in data.training),
        position=(-travel, travel),
        velocity=_SPEED * max(float(np.max(np.abs(speed))) for _, speed in motions),
    )


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
    from idloop.diagnosis import refine
    from idloop.diagnosis.design.next_experiment import suggest_next
    from idloop.errors import IdloopError
    from idloop.signals import build_signal

    try:
        found = suggest_next(ladder, data.training, _limits(data), start=0.0, seed=suite)
    except IdloopError as error:
        return {"resolved": False, "resolution": {"signal": None, "why": str(error)}}
    if found is None:
        return {"resolved": False, "resolution": {"signal": None}}
    suggestion = found.to_dict()
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
