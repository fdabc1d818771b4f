"""Choice of the error of an output to break down: that of the free run, unless it drifts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.validation.measures import nrmse
from idloop.validation.runs import Runs
from idloop.validation.spectrum import line_powers, on_even_steps
from idloop.validation.words import percent, short

# Drift is slower than this many periods in a record. A free run drifts when this share of the error's power about its
# mean is so slow,
_SLOW_PERIODS, _DRIFT = 3.0, 0.5
# at least this share of its power is not constant,
_WANDERS = 0.1
# and the motion has less than this share of its power there, or the error is this large relative to the motion.
_MOTION, _LARGE = 0.3, 0.7


@dataclass(frozen=True)
class Basis:
    """Error to break down."""

    name: str  # ``free_run``, ``ahead`` or ``one_step``
    kind: str  # description of the error
    why: str  # reason why it is not the free run; empty when it is
    error: Array  # shape (n,): measured minus modelled; NaN where one is not known


# Errors of an output, from that which needs the model most to that which needs it least.
FREE_RUN, AHEAD, ONE_STEP = "free_run", "ahead", "one_step"
MEASURES = (FREE_RUN, AHEAD, ONE_STEP)


def choose_basis(runs: Runs, column: int, wanted: str = "") -> Basis:
    """Error of the free run of an output (its column), or of a prediction when the free run drifts.

    Models are compared by one error only: `wanted` is that of the others, and it is taken wherever it is known.
    """
    measured, simulated = runs.measured[:, column], runs.simulated[:, column]
    free = measured - simulated
    reason = drift(runs.time, measured, free)
    if (not reason and wanted in ("", FREE_RUN)) or (wanted == FREE_RUN and np.any(np.isfinite(free))):
        return Basis(FREE_RUN, "free-run error", reason and f"{reason}; it is analysed all the same", free)
    instead = f"{reason}; a prediction is analysed instead" if reason else "as of a model whose free run drifts"
    start = runs.settled
    ahead = measured - runs.ahead[:, column]
    ahead[: start + runs.steps] = np.nan
    if np.any(np.isfinite(ahead)) and wanted != ONE_STEP:
        length = short(runs.steps * runs.record.sample_time)
        kind = f"prediction error {runs.steps} steps ({length} s) ahead"
        return Basis(AHEAD, kind, instead, ahead)
    innovation = runs.innovation[:, column].copy()
    innovation[:start] = np.nan
    if np.any(np.isfinite(innovation)):
        return Basis(ONE_STEP, "one-step prediction error", instead, innovation)
    return Basis(FREE_RUN, "free-run error", reason and f"{reason}, but this model has no observer", free)


def drift(time: Array, measured: Array, error: Array) -> str:
    """Text of how a free run deviates from the measurement; empty when it does not drift.

    `time`, `measured`, `error` (n,): instants [s], measurement and measured minus simulated; NaN where not known.
    """
    known = np.isfinite(measured)
    if not np.all(np.isfinite(error[known])):
        return "the free run does not stay finite"
    if np.sum(known) < 2 or not np.any(error[known]):
        return ""
    size = float(nrmse(measured, measured - error)[0])
    if size > 1.0:
        return "the error of the free run exceeds the deviation of the measurement from its mean"
    _, left = on_even_steps(time[known], error[known])
    step, motion = on_even_steps(time[known], measured[known])
    lines = 1 + int(_SLOW_PERIODS)
    slow, slow_motion = _slow_share(left, lines), _slow_share(motion, lines)
    wandering = float(np.var(left)) > _WANDERS * float(np.mean(left**2))
    if wandering and slow > _DRIFT and (slow_motion < _MOTION or size > _LARGE):
        limit = short(_SLOW_PERIODS / (step * len(left)))
        return f"the free run drifts ({percent(slow)} of its error is slower than {limit} Hz)"
    return ""


def _slow_share(values: Array, lines: int) -> float:
    power = line_powers(values - np.mean(values))
    total = float(np.sum(power))
    return float(np.sum(power[:lines])) / total if total > 0.0 else 0.0
