"""Where a model fails: share of the squared error by what the axis was doing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.motion import differentiate, low_pass

Array = NDArray[np.float64]

# A speed below this share of the typical one counts as standing.
_STANDING = 0.02


def motion_regions(time: Array, velocity: Array) -> dict[str, NDArray[np.bool_]]:
    """Sort samples by the motion: standing, forward, backward, just after a reversal.

    Parameters
    ----------
    time : array, shape (n,)
        Instants [s].
    velocity : array, shape (n,)
        Velocity of the driven body; NaN counts as standing.

    Returns
    -------
    dict of str to array of bool, shape (n,)
        Disjoint, together all samples.
    """
    v = np.nan_to_num(velocity)
    typical = float(np.sqrt(np.mean(v**2)))
    moving = np.abs(v) > _STANDING * typical if typical > 0.0 else np.zeros(len(v), dtype=bool)
    direction = np.where(moving, np.sign(v), 0.0)
    # The last direction of motion, carried through standing still.
    index = np.maximum.accumulate(np.where(direction != 0.0, np.arange(len(v)), 0))
    last = direction[index]
    turns = np.flatnonzero(np.diff(last) != 0.0) + 1
    # "Just after" is a tenth of the typical time between reversals.
    spacing = float(np.median(np.diff(time[turns]))) if len(turns) > 2 else float(time[-1] - time[0])
    since = np.full(len(v), np.inf)
    if len(turns):
        previous = np.searchsorted(turns, np.arange(len(v)), side="right") - 1
        known = previous >= 0
        since[known] = time[known] - time[turns[previous[known]]]
    fresh = since < 0.1 * spacing
    return {
        "after a reversal": fresh & moving,
        "forward": ~fresh & (direction > 0.0),
        "backward": ~fresh & (direction < 0.0),
        "standing": ~moving,
    }


def error_share(error: Array, regions: dict[str, NDArray[np.bool_]]) -> dict[str, dict[str, float]]:
    """Share of the squared error and of the time that falls in each region.

    Parameters
    ----------
    error : array, shape (n,)
        Error of one output; NaN samples are left out.
    regions : dict
        Result of `motion_regions`.

    Returns
    -------
    dict
        ``{region: {"error": share, "time": share}}``; the shares add up to 1.
    """
    square = np.where(np.isfinite(error), error, 0.0) ** 2
    total, count = float(np.sum(square)), max(int(np.sum(np.isfinite(error))), 1)
    return {
        name: {
            "error": float(np.sum(square[inside])) / total if total > 0.0 else 0.0,
            "time": float(np.sum(np.isfinite(error[inside]))) / count,
        }
        for name, inside in regions.items()
    }


def smooth_velocity(time: Array, position: Array) -> Array:
    """Velocity for sorting samples, from a measured position.

    Parameters
    ----------
    time, position : array, shape (n,)
        Position may have NaN gaps; they are bridged.

    Returns
    -------
    array, shape (n,)
    """
    known = np.isfinite(position)
    filled = np.interp(time, time[known], position[known])
    step = float(np.median(np.diff(time)))
    return differentiate(low_pass(filled, 0.05 / step, step), step)
