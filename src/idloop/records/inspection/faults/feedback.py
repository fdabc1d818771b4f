"""A loop that was closed without its reference on record: the command answers to the newest motion.

What is new in a measurement, its noise and its steps, was not known to any command before. Where it shows in the next
command, the command was computed from it.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Mask
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.spelling import joined_names

# Past commands (enough for a sum of eight sines, which follows from its past), older measurements, and newest
# measurements of the regression; samples used.
_PAST, _OLD, _NEW, _MOST, _FEWEST = 16, 6, 4, 20_000, 300
# Share of what is new in the command that the newest measurements explain, without the largest errors: those are steps
# of a reference.
_SHARE, _STEPS = 0.25, 0.1
_SAME_RATE = 0.1
# An interval of so many periods has lost a sample.
_LOST = 1.5
# Share of the samples at which the command changes; and of its changes that are rounding.
_CHANGES, _ROUNDING = 0.2, 1e-9
# A step of the command, in medians of its changes; and share of the rows without one that are enough.
_STEP, _PLAIN = 12.0, 0.75
# Parts of the rows, each predicted from the others.
_PARTS = 8


def check(axis: Axis) -> list[Finding]:
    """Predict the command with and without the newest measurements."""
    if axis.has_reference or axis.command.size < _FEWEST or axis.time.size < _FEWEST:
        return []
    if abs(float(np.median(np.diff(axis.input_time))) / axis.period - 1.0) > _SAME_RATE:
        return []
    signals = {
        axis.name(name): one for name, one in (("position", axis.place), ("velocity", axis.velocity)) if one is not None
    }
    share = _explained(axis, list(signals.values()))
    if share < _SHARE:
        return []
    name = axis.command_name
    return [
        fault(
            "unrecorded_reference",
            name,
            f"{name} answers to the newest {joined_names(list(signals))} ({100 * share:.0f} % of what is new in it): a"
            " loop was closed, and its reference is not on record",
            "record the reference (topic `reference`, `reference:` in the mapping), and judge a model by the command",
            evidence={"share": share},
            spoils=("open-loop black-box models",),
        )
    ]


def _explained(axis: Axis, signals: list[Array]) -> float:
    """Share of a command, beyond those before it, that the newest measurements explain.

    From command to command, so that a log of two clocks repeats and leaves out measurements and no commands: those
    before an even sine tell where it goes on.
    """
    newest = np.searchsorted(axis.time, axis.input_time + 1e-3 * axis.period, side="right") - 1
    measured = [one[np.maximum(newest, 0)] for one in signals]
    good = (newest >= 0) & np.isfinite(axis.command) & np.isfinite(measured).all(axis=0)
    # What is new is the step of one sample: no row may reach over a missing one.
    lost = np.append(0, np.cumsum(np.diff(axis.time) > _LOST * axis.period))[np.maximum(newest, 0)]
    steps = np.diff(axis.input_time)
    good &= np.append(True, (np.diff(lost) == 0) & (steps < _LOST * float(np.median(steps))))
    # Differences: no offset, no drift, and no large common part.
    command, whole = np.diff(axis.command[-_MOST:]), good[-_MOST:]
    motions = [np.diff(one[-_MOST:]) for one in measured]
    last = max(_PAST, _OLD + _NEW - 1)
    rows = last + np.flatnonzero(np.lib.stride_tricks.sliding_window_view(whole, last + 2).all(axis=1))
    if rows.size < _FEWEST:
        return 0.0
    # Behind a step its past says less than the motion, which follows the command and not the noise of its reading.
    size = np.abs(command)
    step = size > _STEP * float(np.median(size[size > 0.0])) if (size > 0.0).any() else size > 0.0
    steps_before = np.append(0, np.cumsum(step))
    plain = rows[steps_before[rows] == steps_before[rows - _PAST]]
    rows = plain if plain.size > _PLAIN * rows.size else rows
    # Where the command is held over many samples, only its changes may answer to anything.
    target = command[rows]
    if np.mean(target != 0.0) < _CHANGES or not all(np.any(one) for one in motions):
        return 0.0
    # A steady ramp of the command follows from its past: that is the constant.
    known = np.column_stack(
        [np.ones(rows.size)]
        + [command[rows - k] for k in range(1, _PAST + 1)]
        + [one[rows - k] for one in motions for k in range(_NEW, _OLD + _NEW)]
    )
    new = np.column_stack([one[rows - k] for one in motions for k in range(_NEW)])
    before, after_new = _power(known, target), _power(np.hstack([known, new]), target)
    floor = (_ROUNDING * float(np.sqrt(np.mean(target**2)))) ** 2
    return 1.0 - after_new / before if before > floor else 0.0


def _power(table: Array, target: Array) -> float:
    """Mean square error, without the largest errors, of predictions of each part of the rows from the other parts.

    More columns fit more of the rows that they are fitted to; rows that they are not fitted to they predict better
    only where they tell something.
    """
    errors = np.empty(target.size)
    for part in np.array_split(np.arange(target.size), _PARTS):
        keep = np.ones(target.size, dtype=bool)
        keep[part] = False
        others = np.flatnonzero(keep)
        for _ in range(2):
            left = _left(table, target, keep)
            size = np.abs(left[others])
            keep[others] = size <= np.quantile(size, 1.0 - _STEPS)
        errors[part] = left[part] ** 2
    return float(np.mean(np.sort(errors)[: max(int(errors.size * (1.0 - _STEPS)), 1)]))


def _left(table: Array, target: Array, keep: Mask) -> Array:
    size = np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    weights = np.linalg.lstsq(table[keep] / size, target[keep], rcond=1e-12)[0]
    return np.asarray(target - (table / size) @ weights)
