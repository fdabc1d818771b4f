"""Whether errors change in proportion to the parameters: where sides strike in a gap, motion may be chaotic.

Two runs of a machine that rattles in its gap part until they differ by as much as they can, however little their
parameters differ. A search then ends in the next small hollow, whose slopes make standard errors far too small.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Step to both sides, as a part of a parameter's typical size.
_STEP = 1e-3
# Ratio of what the changes to both sides have in common to what they have not: infinite where errors are smooth, about
# 0.6 where the changes are noise.
_STEADY = 2.0
# Changes below this many standard deviations in all are of no weight.
_SEEN = 1.0


def is_rough(
    function: Callable[[Array], Array], point: Array, lower: Array, upper: Array, scale: Array, count: int
) -> bool:
    """Whether the errors beside a point are out of all proportion to a small step.

    Parameters
    ----------
    function : callable
        Residual in units of its standard deviation.
    point, lower, upper, scale : array, shape (k,)
        The point, its box, typical sizes.
    count : int
        Number of parameters to look along, the first ones.
    """
    residual = function(point)
    for index in range(count):
        step = _STEP * scale[index]
        if not lower[index] <= point[index] - step < point[index] + step <= upper[index]:
            continue
        sides = []
        for sign in (1.0, -1.0):
            moved = point.copy()
            moved[index] += sign * step
            sides.append(function(moved) - residual)
        common, apart = (float(np.linalg.norm(sides[0] + sign * sides[1])) for sign in (-1.0, 1.0))
        if common + apart > 2.0 * _SEEN and not common > _STEADY * apart:
            return True
    return False
