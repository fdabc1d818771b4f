"""Readings far outside of all others, which hide the motion: an overflow, a lost bit, a frame read askew."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers

# Off the median of the samples around it by this many ranges of that median, which single values do not change.
_BEYOND, _AROUND = 4.0, 5
# Share of the samples above which they are no single ones.
_MOST = 0.01
_FEWEST = 30


def bad_readings(value: Array) -> Integers:
    """Return the samples of a signal (n,) of which one or two at a time lie far beyond the range of all others."""
    known = np.flatnonzero(np.isfinite(value))
    nothing = np.zeros(0, dtype=np.int64)
    if known.size < _FEWEST:
        return nothing
    x = value[known]
    usual = float(np.diff(np.quantile(x, [_MOST, 1.0 - _MOST]))[0])
    with np.errstate(over="ignore"):
        if not np.ptp(x) > _BEYOND * usual:
            return nothing
        middle = np.median(np.lib.stride_tricks.sliding_window_view(x, _AROUND), axis=1)
        middle = np.pad(middle, _AROUND // 2, mode="edge")
        span = float(np.ptp(middle))
        rows = np.flatnonzero(np.abs(x - middle) > _BEYOND * span)
    found: Integers = known[rows]
    # Beside a signal that never moves, a step of its sensor would be as far.
    return found if span > 0.0 and rows.size <= _MOST * x.size else nothing


def without_bad_readings(value: Array) -> Array:
    """Return a signal (n,) with NaN for its bad readings."""
    rows = bad_readings(value)
    if not rows.size:
        return value
    left: Array = value.copy()
    left[rows] = np.nan
    return left
