"""Values that are repeated with new stamps: the log is faster than the sensor, or a value was sent again.

An axis under way passes several steps of its sensor in a sample, so that equal values are as rare as any other step. A
sensor that was not read gives equal values far more often than values one step apart.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers
from idloop.records.inspection.motion import ROUNDING

# Samples on each side that give the speed, the steps of the sensor that pass in a sample, and repeats that count.
_BESIDE, _STEPS = 8, 4.0
FEWEST, SHARE, _OFTENER = 10, 0.01, 5.0
# Ratio of the speeds before and after; share of the travel since the last new value that the next one catches up.
_STEADY, _CATCHES_UP = 0.3, 0.6
FASTER_LOG = 0.3  # share of the values in motion from which on the log is faster than the sensor


def without_repeats(value: Array) -> Array:
    """Return a signal (n,) with NaN where a log that is faster than its sensor repeats the value before.

    At rest, where equal values are as good as any, as many are kept as the sensor gives.
    """
    known = np.flatnonzero(np.isfinite(value))
    rows, moving = repeats(value[known])
    share = rows.size / max(moving, 1)
    if rows.size < FEWEST or share <= FASTER_LOG:
        return value
    fresh = np.concatenate([[True], np.diff(value[known]) != 0.0])
    last = np.maximum.accumulate(np.where(fresh, np.arange(fresh.size), 0))
    again = (np.arange(fresh.size) - last) % round(1.0 / max(1.0 - share, SHARE)) != 0
    found: Array = value.copy()
    found[known[again]] = np.nan
    return found


def repeats(value: Array) -> tuple[Integers, int]:
    """Return the intervals without a change while there is motion, and the number of intervals in motion."""
    if value.size < 8 * _BESIDE:
        return np.zeros(0, dtype=np.int64), 0
    step = np.diff(value)
    # One level may come in several ways that differ in the last digits.
    step[np.abs(step) <= ROUNDING * np.ptp(value)] = 0.0
    change = np.flatnonzero(step != 0.0)
    if not change.size:
        return change, 0
    changes = np.abs(step[change])
    resolution = float(np.percentile(changes, 1.0)) if np.unique(changes).size > 0.2 * changes.size else changes.min()
    # Under way on both sides: a standstill beside a motion is no repeat.
    early, late = np.zeros(step.size), np.zeros(step.size)
    early[_BESIDE:] = np.abs(value[_BESIDE:-1] - value[: -_BESIDE - 1])
    late[:-_BESIDE] = np.abs(value[_BESIDE + 1 :] - value[1:-_BESIDE])
    least = _STEPS * _BESIDE * resolution
    moving = np.minimum(early, late) > np.maximum(least, _STEADY * np.maximum(early, late))
    # The next value catches up with the motion; an axis that stops and starts does not.
    following = np.searchsorted(change, np.arange(step.size))
    next_change = change[np.minimum(following, change.size - 1)]
    before = np.where(following > 0, change[np.maximum(following, 1) - 1], -1)
    travel = (next_change - before) * (early + late) / (2.0 * _BESIDE)
    catches_up = np.abs(step[next_change]) > _CATCHES_UP * travel
    rows = np.flatnonzero(moving & catches_up & (step == 0.0))
    # On steps of the sensor, noise alone makes as many small changes as none, with the same step after them.
    tiny = moving[:-1] & (step[:-1] != 0.0) & (np.abs(step[:-1]) < 1.5 * resolution)
    small = np.count_nonzero(tiny & (np.abs(step[1:]) > _CATCHES_UP * (early + late)[:-1] / _BESIDE))
    return (rows if rows.size > _OFTENER * 0.5 * small else rows[:0]), int(moving.sum())
