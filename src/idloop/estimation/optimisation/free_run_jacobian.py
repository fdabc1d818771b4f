"""Jacobian of free-run errors by sensitivity equations."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.optimisation.levenberg import difference_jacobian
from idloop.estimation.simulation import SimulationCriterion

# Change of a parameter, as a part of its size, for the derivatives of the forces.
_CHANGE = 1e-6
# Largest relative deviation from a difference quotient: a sensitivity equation does not see that a break-away moves to
# another integration step.
_AGREED = 0.03


class FreeRunJacobian:
    """Jacobian of a free-run problem by sensitivity equations; by differences where these do not apply.

    `problem`: with a `SimulationCriterion`; `lower`, `upper`, `scale` (k + q,): bounds and typical sizes of parameters
    and nuisance; `step` (k + q,): steps of the differences.
    """

    def __init__(self, problem: LeastSquaresProblem, lower: Array, upper: Array, scale: Array, step: Array) -> None:
        self.problem, self.lower, self.upper, self.scale, self.step = problem, lower, upper, scale, step

    def __call__(self, point: Array) -> Array:
        """Jacobian at a point, shape (n, k + q)."""
        exact = self._exact(point)
        return self._differences(point) if exact is None or np.any(np.isnan(exact[0])) else exact

    def agree(self, point: Array) -> bool:
        """Whether sensitivity equations apply at a point, and agree with differences."""
        exact = self._exact(point)
        if exact is None:
            return False
        differences = self._differences(point)
        apart = np.linalg.norm(exact - differences, axis=0)
        return bool(np.all(apart <= _AGREED * np.linalg.norm(differences, axis=0)))

    def _differences(self, point: Array) -> Array:
        return difference_jacobian(
            self.problem.residual, point, self.problem.residual(point), self.lower, self.upper, self.step, self.scale
        )[0]

    def _exact(self, point: Array) -> Array | None:
        """Jacobian by sensitivity equations, NaN where they do not apply."""
        criterion, k = self.problem.criterion, self.problem.parameters
        if not isinstance(criterion, SimulationCriterion):
            return None
        change = _CHANGE * self.scale[:k]
        change = np.where(point[:k] + change > self.upper[:k], -change, change)
        slopes = criterion.slopes(point[:k], point[k:], change)
        return None if slopes is None else self.problem.weighted_jacobian(slopes)
