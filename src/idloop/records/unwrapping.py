"""Unwrapping of encoders with a limited range.

A step of more than half the range is a wrap. During a gap of the log the axis may have turned further: the number of
turns is then estimated from the speeds on both sides, and is doubtful where these differ much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError

# A gap is longer than this many usual steps; speeds beside it are means over this many.
_GAP, _BESIDE = 5.0, 10
# Half of the range: beyond it another number of turns is nearer.
_HALF = 0.5


@dataclass(frozen=True)
class Unwrapped:
    """A continuous position."""

    value: Array  # shape (n,): positions in their unit; NaN where they were
    # Start [s] and length [s] of the gaps over which another number of turns is as likely
    doubtful: tuple[tuple[float, float], ...]


def unwrap(time: Array, value: Array, span: float) -> Unwrapped:
    """Undo the wrap of an encoder that repeats after `span`.

    `time` (n,): stamps [s], not decreasing.
    `value` (n,): positions; NaN stays NaN.
    `span`: declared range, e.g. 2π or 4096 counts, in the unit of `value`.
    Raises InputError: a range that is not positive.
    """
    if not span > 0:
        raise InputError(f"encoder range {span:g}; it must be positive, e.g. 6.283185 for one turn in rad")
    known = np.isfinite(value)
    t, x = time[known], np.unwrap(value[known], period=span)
    passed = np.diff(t)
    usual = float(np.median(passed[passed > 0.0])) if np.any(passed > 0.0) else np.inf
    gaps = np.flatnonzero(passed > _GAP * usual)
    step = np.diff(x)
    # The runs between the gaps, each from its first sample to its last.
    first, last = np.concatenate([[0], gaps + 1]), np.concatenate([gaps, [len(x) - 1]])
    turns, doubtful = np.zeros(len(step)), []
    for place, gap in enumerate(gaps):
        beside = (
            _speed(t, x, max(first[place], last[place] - _BESIDE), last[place]),
            _speed(t, x, first[place + 1], min(last[place + 1], first[place + 1] + _BESIDE)),
        )
        speeds = [speed for speed in beside if np.isfinite(speed)]
        if not speeds:
            doubtful.append((float(t[gap]), float(passed[gap])))
            continue
        travel = np.array(speeds) * passed[gap]
        turns[gap] = np.round((np.mean(travel) - step[gap]) / span)
        off = abs(np.mean(travel) - step[gap] - turns[gap] * span) + 0.5 * np.ptp(travel)
        if off > _HALF * span:
            doubtful.append((float(t[gap]), float(passed[gap])))
    result = value.astype(np.float64)
    result[known] = x + span * np.concatenate([[0.0], np.cumsum(turns)])[: len(x)]
    return Unwrapped(result, tuple(doubtful))


def _speed(time: Array, value: Array, start: int, end: int) -> float:
    """Mean speed from one sample to another; NaN where no time passes."""
    passed = time[end] - time[start]
    return float((value[end] - value[start]) / passed) if passed > 0.0 else np.nan
