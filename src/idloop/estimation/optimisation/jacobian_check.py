"""Check of a Jacobian: whether the errors change in proportion to the parameters.

The motion of a machine that chatters in its backlash may be chaotic: two simulations diverge however little their
parameters differ. A search then ends in a local optimum, and its Jacobian gives far too small standard errors.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from idloop.arrays import Array

# Step to both sides, as a part of a parameter's typical size.
_STEP = 1e-3
# Least ratio of the odd to the even part of the changes: infinite for smooth errors, about 0.6 for noise.
_SMOOTH = 2.0
# Changes of a norm below this many standard deviations are ignored.
_LEAST_CHANGE = 1.0


def jacobian_unreliable(
    function: Callable[[Array], Array], point: Array, lower: Array, upper: Array, scale: Array, count: int
) -> bool:
    """Whether small steps from a point change the errors out of all proportion.

    `function`: residual in units of its standard deviation; `point`, `lower`, `upper`, `scale` (k,): the point, its
    box, typical sizes; `count`: number of parameters to step along, the first ones.
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
        odd, even = (float(np.linalg.norm(sides[0] + sign * sides[1])) for sign in (-1.0, 1.0))
        if odd + even > 2.0 * _LEAST_CHANGE and not odd > _SMOOTH * even:
            return True
    return False
