"""A velocity that stays at the limit of its sensor, or of what computes it, while the position goes on faster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Mask
from idloop.records.inspection.axis import sensor_step
from idloop.records.inspection.motion import white_noise

# Samples in a row that have the largest value, and their share of the record, from which they are at a limit.
_IN_A_ROW, _SHARE = 3, 0.005
# The position goes faster there by this share of the limit, by so many of its errors, and by a step of the velocity.
_FASTER, _CERTAIN = 0.03, 5.0
# Elsewhere the velocity is the slope of the position, up to this share.
_AGREES = 0.1


@dataclass(frozen=True)
class VelocityLimit:
    """Where a velocity is cut off."""

    value: float  # the limit, in the unit of the velocity; of two the one that is held longer
    share: float  # share of the samples at a limit
    faster: float  # mean speed of the position there, over the limit


def velocity_limit(time: Array, position: Array, velocity: Array) -> VelocityLimit | None:
    """Find the limit at which a velocity is cut off; None where it is not.

    Parameters
    ----------
    time : array, shape (n,)
        Stamps [s], increasing.
    position, velocity : array, shape (n,)
        In matching units, at the same stamps; NaN where not measured.
    """
    known = np.isfinite(position) & np.isfinite(velocity)
    when, where, speed = time[known], position[known], velocity[known]
    if when.size < 100 or float(np.ptp(speed)) == 0.0:
        return None
    limits = [limit for limit in (float(speed.max()), float(speed.min())) if limit != 0.0]
    runs = [(limit, *run) for limit in limits for run in _runs(speed == limit)]
    held = sum(stop - start for _, start, stop in runs)
    if not runs or held < _SHARE * when.size:
        return None
    moved = sum(np.sign(limit) * (where[stop - 1] - where[start]) for limit, start, stop in runs)
    at_limit = sum(abs(limit) * (when[stop - 1] - when[start]) for limit, start, stop in runs)
    lasted = sum(when[stop - 1] - when[start] for _, start, stop in runs)
    error = max(white_noise(where), sensor_step(where)) * (2.0 * len(runs)) ** 0.5
    least = max(_FASTER * at_limit, _CERTAIN * error, sensor_step(speed) * lasted)
    if moved - at_limit < least or abs(_elsewhere(when, where, speed, limits) - 1.0) > _AGREES:
        return None
    longest = max(limits, key=lambda one: sum(stop - start for limit, start, stop in runs if limit == one))
    return VelocityLimit(longest, held / when.size, float(moved / at_limit))


def _runs(at: Mask) -> list[tuple[int, int]]:
    """First and last but one row of the runs in which a mask (n,) holds for some rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(np.int8), [0]])))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(start, stop) for start, stop in pairs if stop - start >= _IN_A_ROW]


def _elsewhere(when: Array, where: Array, speed: Array, limits: list[float]) -> float:
    """Slope of the position over the velocity, away from its limits; NaN where it does not move there."""
    free = ~np.isin(speed, limits)
    free = free[1:] & free[:-1]
    mean, step = 0.5 * (speed[1:] + speed[:-1])[free], np.diff(when)[free]
    size = float(np.sum(mean**2 * step))
    return float(np.sum(mean * np.diff(where)[free])) / size if size > 0.0 else float("nan")
