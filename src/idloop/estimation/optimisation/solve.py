"""Minimisation of a criterion by alternating between its noise model and its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.optimisation.free_run_jacobian import FreeRunJacobian
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise, probed_size

_MOST_ROUNDS = 15
_ITERATIONS_PER_ROUND = 10
# Moves, in standard errors, below which a search ends; of the first search with one-sided differences, where there is
# no whitening; and of a search for starting values only.
_SETTLED, _NEARLY, _CLOSE = 0.03, 0.15, 0.5
# Steps with two-sided differences at the end; further ones would only move poorly determined initial states.
_LAST_STEPS = 2


@dataclass(frozen=True)
class Solution:
    """End of a search, with all that the covariance needs."""

    problem: LeastSquaresProblem
    theta: Array
    nuisance: Array
    jacobian: Array
    step: Array
    scale: Array
    lower: Array
    upper: Array
    iterations: int
    converged: bool


def typical_size(values: Array, lower: Array, upper: Array) -> Array:
    """Typical size of parameters (k,): their value, or a hundredth of a finite range where that is 0."""
    size = np.abs(values)
    span = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    return np.where(size > 0, size, np.where(span > 0, 1e-2 * span, 1.0))


def _probed_size(problem: LeastSquaresProblem, point: Array, scale: Array, index: int, upper: Array) -> float:
    """Size of a parameter that starts at 0, from its influence on the residual."""
    base = problem.residual(point)

    def change(step: float) -> float:
        moved = point.copy()
        moved[index] += step if moved[index] + step <= upper[index] else -step
        return float(np.linalg.norm(problem.residual(moved) - base))

    return probed_size(change, float(scale[index]))


def solve(
    criterion: Criterion,
    start: Array,
    lower: Array,
    upper: Array,
    report: Callable[[float, str], None] | None = None,
    draft: bool = False,
    typical: Array | None = None,
    exact_slopes: bool = False,
) -> Solution:
    """Minimise a criterion over the parameters and its own nuisance parameters.

    `start`, `lower`, `upper` (k,); `report`: called with the share done and a short text; `draft`: end within a
    standard error: a start for another search; `typical` (k,): other values of the parameters, as the size of those
    that start at 0; `exact_slopes`: use sensitivity equations, which have been checked near the start (`slopes_agree`).
    Raises IdloopError: if the model gives no finite errors at the start, or beside a point of the search.
    """
    theta = np.clip(start, lower, upper)
    k = len(theta)
    problem = LeastSquaresProblem(criterion, k)
    sizes = np.zeros(0)
    step: Array | None = None
    iterations, settled, exact = 0, False, False
    previous = theta
    slopes: Array | None = None
    near = _CLOSE if draft else _SETTLED if criterion.whiten else _NEARLY
    for round_ in range(_MOST_ROUNDS):
        criterion.retune(theta)
        nuisance, nuisance_lower, nuisance_upper, nuisance_scale = criterion.nuisance()
        point = np.concatenate([theta, nuisance])
        low, high = np.concatenate([lower, nuisance_lower]), np.concatenate([upper, nuisance_upper])
        weights = problem.weights
        # In the first round the errors are mostly misfit, not noise.
        with np.errstate(all="ignore"):
            try:
                problem.reweigh(point, criterion.whiten and round_ > 0)
            except np.linalg.LinAlgError as failure:
                raise IdloopError(
                    "the model gives no finite output at its starting values; check signs and magnitudes"
                ) from failure
        if len(sizes) == 0:
            sizes = typical_size(theta, lower, upper)
            known = np.zeros(k) if typical is None else np.abs(typical)
            sizes = np.where((theta == 0.0) & (known > 0.0), known, sizes)
            for i in np.flatnonzero((theta == 0.0) & (known == 0.0)):
                sizes[i] = _probed_size(problem, point, sizes, int(i), high)
        now = np.where(theta != 0.0, np.maximum(np.abs(theta), 1e-3 * sizes), sizes)
        scale = np.concatenate([now, nuisance_scale])
        if step is not None and len(step) != len(point):
            step = None
        # The search uses one-sided differences, updated over steps and rounds, and ends with two-sided ones;
        # sensitivity equations serve for both from the second round on.
        exact = exact or (exact_slopes and round_ > 0)
        borrowed = None if exact or slopes is None else problem.reweighted_jacobian(slopes, weights)
        first = 1e-4 * scale if step is None else step
        derivative = FreeRunJacobian(problem, low, high, scale, first) if exact_slopes else None
        goal = _SETTLED if exact else near
        found = minimise(
            problem.residual, point, low, high, scale, step, quick=True, central=exact, leading=k, jacobian=borrowed,
            draft=True, max_iterations=_LAST_STEPS if exact and not criterion.whiten else _ITERATIONS_PER_ROUND,
            tolerance=0.5 * goal**2, derivative=derivative,
        )  # fmt: skip
        if not np.all(np.isfinite(found.jacobian)):
            raise IdloopError(
                "the model gives no finite output near the values that the search has reached; give its parameters"
                " narrower bounds, or start elsewhere"
            )
        slopes = None if criterion.whiten else found.jacobian
        theta, nuisance, step = found.point[:k], found.point[k:], found.step
        criterion.keep(nuisance)
        iterations += found.iterations
        error = _conditional_errors(found.jacobian, k)
        moved = float(np.max(np.abs(theta - previous) / np.maximum(error, 1e-9 * scale[:k])))
        previous = theta
        if report is not None:
            report(round_ / _MOST_ROUNDS, f"round {round_ + 1}, objective {problem.objective:.6g}")
        if round_ < (2 if criterion.whiten else 1) or moved >= near or not (exact or found.converged):
            continue
        if exact or draft:
            settled = True
            break
        exact = True
    residual = problem.residual(found.point)
    jacobian = found.jacobian
    if len(jacobian) != len(residual) or not (exact or draft):
        jacobian, _ = difference_jacobian(problem.residual, found.point, residual, low, high, found.step, scale)
    return Solution(problem, theta, nuisance, jacobian, found.step, scale, low, high, iterations, settled)


def slopes_agree(found: Solution) -> bool:
    """Whether sensitivity equations agree with differences at the end of a search by a `SimulationCriterion`."""
    slopes = FreeRunJacobian(found.problem, found.lower, found.upper, found.scale, found.step)
    return slopes.agree(np.concatenate([found.theta, found.nuisance]))


def _conditional_errors(jacobian: Array, parameters: int) -> Array:
    """Standard errors from the Hessian, as the unit of moves."""
    hessian = jacobian.T @ jacobian
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    inverse = np.linalg.pinv(hessian / np.outer(size, size), rcond=1e-12, hermitian=True)
    return np.asarray((np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size)[:parameters])
