"""Jumps of a position by the range of its encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Integers

# A wrap crosses this share of the range between two samples, from one end to the other: both within the second share.
_ACROSS, _END = 0.6, 0.25
# It is this many times as large as the step before and after it, and all wraps are equal to this accuracy.
_LARGER, _EQUAL = 5.0, 0.1


@dataclass(frozen=True, eq=False)
class Wraps:
    """Where a position jumps by the range of its encoder."""

    rows: Integers  # samples after the jumps
    span: float  # range of the encoder
    unwrapped: Array  # shape (n,): position without the jumps


def find_wraps(position: Array) -> Wraps | None:
    """Find the jumps of a position (n,) by the range of its encoder; None where there is none.

    A jump counts where the position goes from one end of its range to the other and the motion before and after is
    small and goes the other way, or stands still.
    """
    known = np.flatnonzero(np.isfinite(position))
    x = position[known]
    if x.size < 20 or np.ptp(x) == 0.0:
        return None
    low, high, step = float(np.min(x)), float(np.max(x)), np.diff(x)
    rows = 1 + np.flatnonzero(np.abs(step[1:-1]) > _ACROSS * (high - low))
    before, jump, after = step[rows - 1], step[rows], step[rows + 1]
    beside, rising, near = np.maximum(np.abs(before), np.abs(after)), jump > 0.0, _END * (high - low)
    ends = np.where(rising, x[rows] - low, high - x[rows]) < near
    ends &= np.where(rising, high - x[rows + 1], x[rows + 1] - low) < near
    # The motion goes on over the wrap: on the circle it goes against the jump, or both steps are small by far.
    good = ends & (beside * _LARGER < np.abs(jump)) & (before * jump <= 0.0) & (after * jump <= 0.0)
    rows = rows[good]
    if not rows.size:
        return None
    sizes = (np.abs(jump) + 0.5 * (np.abs(before) + np.abs(after)))[good]
    size = float(np.median(sizes))
    if np.any(np.abs(sizes - size) > _EQUAL * size):
        return None
    unwrapped = position.copy()
    turns = np.zeros(x.size)
    turns[rows + 1] = -np.sign(step[rows])
    unwrapped[known] = x + size * np.cumsum(turns)
    return Wraps(known[rows + 1], size, unwrapped)
