"""What needs the truth: whether the case was testable, and how near the ladder's model comes to the true one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from case import Case
from experiment import Experiment
from machines import MACHINES
from oracle import Oracle
from twins import pieces

# Rounding wider than this many standard deviations of the noise shows in the samples themselves.
VISIBLE_STEP, HIDDEN_STEP = 2.0, 0.5
# Predictions reach ahead by this share of the machine's own time.
REACH = 0.5


def judged(case: Case, data: Experiment, model: Any) -> dict[str, Any]:
    """Gains of the hidden effects, and validation errors of the ladder's and the true model.

    Parameters
    ----------
    case : Case
    data : Experiment
    model : Model
        The ladder's last.

    Returns
    -------
    dict
        ``gains`` by effect (log-likelihood units; see `oracle`), ``rounding`` in noise deviations where
        that is what is hidden, ``validation`` with the errors and their ratio.
    """
    truth = without_rounding(_free_as(data.truth, data.start))
    oracle = Oracle(truth, data.training, data.truth, walking=case.disturbance.kind == "walk")
    gains: dict[str, float] = {}
    for item in case.hidden:
        if item.effect == "sensor_quantisation":
            noise = next(o.noise for o in data.truth.outputs if o.site == item.at)
            gains[item.name] = _gain_of_rounding(item.values["resolution"] / noise)
        elif not pieces(case, data.start, item.name):
            gains[item.name] = 0.0
        else:
            gains[item.name] = oracle.gain([item.name])
    steps = max(round(REACH * MACHINES[case.machine].tempo * case.rate), 1)
    ours = validation_error(model, data, steps)
    best = validation_error(oracle.best, data, steps)
    measure = f"{steps} steps ahead"
    if not np.all(np.isfinite([*ours.values(), *best.values()])):
        measure = "free run"
        ours, best = free_run_error(model, data), free_run_error(oracle.best, data)
    return {
        "gains": {name: round(value, 2) for name, value in gains.items()},
        "validation": {"measure": measure, "ladder": ours, "truth": best, "ratio": ratio(ours, best)},
    }


def _gain_of_rounding(steps: float) -> float:
    """Rounding has no place in a predictor; what is seen of it depends on its size beside the noise."""
    from oracle import HOPELESS, TESTABLE

    if steps >= VISIBLE_STEP:
        return TESTABLE
    return 0.0 if steps < HIDDEN_STEP else HOPELESS


def _free_as(truth: Any, start: Any) -> Any:
    """The true model, with the parameters free that a user would have estimated."""
    own = [p.name for p in truth.parameters if p.free and "@" in p.name]
    held = [
        name
        for name in own
        if name.rsplit(".", 1)[1] in ("resistance", "velocity", "damping") and "stribeck" not in name
    ]
    held = [name for name in held if not name.startswith("compliance")]
    return truth.with_free([*start.free, *(name for name in own if name not in held)])


def without_rounding(model: Any) -> Any:
    """The model without quantisation: a predictor that rounds is a worse one."""
    return model.without_effects(name for name in model.effect_names if name.startswith("sensor_quantisation@"))


def validation_error(model: Any, data: Experiment, steps: int) -> dict[str, float]:
    """Root mean square error of the prediction some steps ahead on data that no fit saw, by output.

    NaN where no linear observer follows the model.
    """
    compared = _compared(model, data, steps)
    error = compared.measured - compared.ahead
    # the observer settles first
    return _rms(compared.names, error[len(error) // 10 :])


def free_run_error(model: Any, data: Experiment) -> dict[str, float]:
    """Root mean square error of the free run on data that no fit saw, by output."""
    compared = _compared(model, data, 1)
    return _rms(compared.names, compared.measured - compared.simulated)


def _compared(model: Any, data: Experiment, steps: int) -> Any:
    from idloop.validation.compare import Comparison

    told = tuple(replace(o, noise=t.noise) for o, t in zip(model.outputs, data.truth.outputs, strict=True))
    return Comparison(replace(without_rounding(model), outputs=told), data.validation[0], steps)


def _rms(names: tuple[str, ...], error: Any) -> dict[str, float]:
    values = np.sqrt(np.mean(error**2, axis=0))
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def ratio(ours: dict[str, float], best: dict[str, float]) -> float:
    """Geometric mean over the outputs of the ratio of errors."""
    return float(np.exp(np.mean([np.log(ours[name] / best[name]) for name in ours])))
