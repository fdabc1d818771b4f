"""Two positions that run together: the sensors of a motor and of the load that it drives through a gear or spring."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.axis import sensor_step

_FEWEST = 20
_TOGETHER = 0.95  # share of the variance of one that a multiple of the other explains


def transmission(place: Array, other: Array) -> float:
    """Return the ratio with which another position runs with a position; 0 where they do not run together.

    `place`, `other` (n,): without jumps at the ends of their ranges; NaN where not measured.
    """
    if place.size != other.size:
        return 0.0
    known = np.isfinite(place) & np.isfinite(other)
    if known.sum() < _FEWEST or not (np.ptp(place[known]) and np.ptp(other[known])):
        return 0.0
    one, two = place[known] - np.mean(place[known]), other[known] - np.mean(other[known])
    across = float(one @ two)
    return across / float(one @ one) if across**2 > _TOGETHER * float(one @ one) * float(two @ two) else 0.0


def has_slack(place: Array, other: Array) -> bool:
    """Whether two positions run together but for more than their steps: there is play or a spring between them."""
    ratio = transmission(place, other)
    if not ratio:
        return False
    left = other - ratio * place
    return float(np.nanstd(left)) > sensor_step(other) + abs(ratio) * sensor_step(place)
