"""A velocity that stays at the limit of its sensor, or of what computes it, while the position goes on faster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.axis import sensor_step
from idloop.records.inspection.motion import white_noise
from idloop.records.inspection.values import runs

# Samples in a row that have the largest value, and their share of the record, from which they are at a limit.
_IN_A_ROW, _SHARE, _FEWEST = 3, 0.005, 100
# The position goes faster there by this share of the limit, by so many of its errors, and by a step of the velocity.
_FASTER, _CERTAIN = 0.03, 5.0
_AGREES = 0.1  # elsewhere the velocity is the slope of the position, up to this share


@dataclass(frozen=True)
class VelocityLimit:
    """Where a velocity is cut off."""

    value: float  # the limit, in the unit of the velocity; of two the one that is held longer
    share: float  # share of the samples at a limit
    faster: float  # mean speed of the position there, over the limit


def velocity_limit(time: Array, position: Array, velocity: Array) -> VelocityLimit | None:
    """Find the limit at which a velocity is cut off; None where it is not.

    `time` (n,): stamps [s], increasing.
    `position`, `velocity` (n,): in matching units, at the same stamps; NaN where not measured.
    """
    known = np.isfinite(position) & np.isfinite(velocity)
    when, where, speed = time[known], position[known], velocity[known]
    if when.size < _FEWEST or float(np.ptp(speed)) == 0.0:
        return None
    limits = [limit for limit in (float(speed.max()), float(speed.min())) if limit != 0.0]
    found = [
        (limit, stop - start, when[stop - 1] - when[start], where[stop - 1] - where[start])
        for limit in limits
        for start, stop in runs(speed == limit)
        if stop - start >= _IN_A_ROW
    ]
    limit, samples, seconds, travel = np.array(found).reshape(-1, 4).T
    if samples.sum() < _SHARE * when.size:
        return None
    moved, at_limit = float(np.sign(limit) @ travel), float(np.abs(limit) @ seconds)
    error = max(white_noise(where), sensor_step(where)) * (2.0 * len(found)) ** 0.5
    least = max(_FASTER * at_limit, _CERTAIN * error, sensor_step(speed) * float(seconds.sum()))
    if moved - at_limit < least or abs(_elsewhere(when, where, speed, limits) - 1.0) > _AGREES:
        return None
    longest = max(limits, key=lambda one: float(samples[limit == one].sum()))
    return VelocityLimit(longest, float(samples.sum()) / when.size, moved / at_limit)


def _elsewhere(when: Array, where: Array, speed: Array, limits: list[float]) -> float:
    """Slope of the position over the velocity, away from its limits; NaN where it does not move there."""
    free = ~np.isin(speed, limits)
    free = free[1:] & free[:-1]
    mean, step = 0.5 * (speed[1:] + speed[:-1])[free], np.diff(when)[free]
    size = float(np.sum(mean**2 * step))
    return float(np.sum(mean * np.diff(where)[free])) / size if size > 0.0 else float("nan")
