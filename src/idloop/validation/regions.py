"""Where a model fails: share of the squared error by what the axis was doing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.force_balance.motion import differentiate, low_pass

Array = NDArray[np.float64]

# A speed below this share of the typical one counts as standing.
STANDING = 0.02


def direction_of(velocity: Array, floor: float = 0.0) -> Array:
    """Direction of motion: 1 forward, -1 backward, 0 standing.

    Parameters
    ----------
    velocity : array, shape (n,)
        NaN counts as standing.
    floor : float
        Speed that the sensor's noise alone shows; 2 % of the typical speed when that is more.

    Returns
    -------
    array, shape (n,)
    """
    v = np.nan_to_num(velocity)
    typical = float(np.sqrt(np.mean(v**2)))
    return np.where(np.abs(v) > max(STANDING * typical, floor), np.sign(v), 0.0)


def since_reversal(time: Array, direction: Array) -> tuple[Array, NDArray[np.int64]]:
    """Time since the axis last moved the other way.

    Parameters
    ----------
    time : array, shape (n,)
        Instants [s].
    direction : array, shape (n,)
        Result of `direction_of`. Standing still between two stretches of one direction is no reversal, nor is
        the first start from rest.

    Returns
    -------
    since : array, shape (n,)
        Time [s]; infinite before the first reversal.
    turns : array of int
        First sample of each new direction.
    """
    # The last direction of motion, carried through standing still.
    index = np.maximum.accumulate(np.where(direction != 0.0, np.arange(len(direction)), 0))
    last = direction[index]
    turns = np.flatnonzero((np.diff(last) != 0.0) & (last[:-1] != 0.0)) + 1
    since = np.full(len(direction), np.inf)
    if len(turns):
        previous = np.searchsorted(turns, np.arange(len(direction)), side="right") - 1
        known = previous >= 0
        since[known] = time[known] - time[turns[previous[known]]]
    return since, turns


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
    direction = direction_of(velocity)
    since, turns = since_reversal(time, direction)
    # "Just after" is a tenth of the typical time between reversals.
    spacing = float(np.median(np.diff(time[turns]))) if len(turns) > 2 else float(time[-1] - time[0])
    fresh = since < 0.1 * spacing
    return {
        "after a reversal": fresh & (direction != 0.0),
        "forward": ~fresh & (direction > 0.0),
        "backward": ~fresh & (direction < 0.0),
        "standing": direction == 0.0,
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
