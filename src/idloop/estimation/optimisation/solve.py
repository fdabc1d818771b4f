"""The search: alternate between tuning the noise model and moving the parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.optimisation.free_run_jacobian import FreeRunSlopes
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise
from idloop.estimation.optimisation.problem import Problem

Array = NDArray[np.float64]

_MOST_ROUNDS = 15
_ITERATIONS_PER_ROUND = 10
# Moves below this share of a standard error end the search, and with it steps that are not worth that much ...
_SETTLED = 0.03
# ... those below this one the search with one-sided slopes, where the noise has only to be weighed ...
_NEARLY = 0.15
# ... and those below this one a search for a start.
_CLOSE = 0.5
# Steps with two-sided slopes at the end: what they still move are initial states that the data hardly show.
_LAST_STEPS = 2


@dataclass(frozen=True)
class Solution:
    """Where a search ended, with everything the covariance needs."""

    problem: Problem
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
    """Typical size of parameters: their value, or a part of a finite range where that is 0.

    Parameters
    ----------
    values, lower, upper : array, shape (k,)

    Returns
    -------
    array, shape (k,)
        Positive.
    """
    size = np.abs(values)
    span = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    return np.where(size > 0, size, np.where(span > 0, 1e-2 * span, 1.0))


def _probed_size(problem: Problem, point: Array, scale: Array, index: int, upper: Array) -> float:
    """Size of a parameter that starts at 0: the change that moves the residual by a few units."""
    base = problem.residual(point)
    best, distance = scale[index], np.inf
    for exponent in range(-8, 7):
        moved = point.copy()
        step = 10.0**exponent
        moved[index] += step if moved[index] + step <= upper[index] else -step
        norm = float(np.linalg.norm(problem.residual(moved) - base))
        if np.isfinite(norm) and norm > 0.0 and abs(np.log(norm / 10.0)) < distance:
            best, distance = step, abs(np.log(norm / 10.0))
    return float(best)


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

    Parameters
    ----------
    criterion : Criterion
    start, lower, upper : array, shape (k,)
    report : callable, optional
        Called with the share done and a short text.
    draft : bool
        A start for another search is wanted: within a standard error is near enough.
    typical : array, shape (k,), optional
        Values of the parameters elsewhere, which tell the size of those that start at 0.
    exact_slopes : bool
        Whether exact slopes of free runs have agreed with differences close to the start (`slopes_agree`).

    Raises
    ------
    IdloopError
        If the model gives no finite errors at the start, or beside the values that the search comes to.
    """
    theta = np.clip(start, lower, upper)
    k = len(theta)
    problem = Problem(criterion, k)
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
        # The first round is too far off for what is left over to be noise.
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
        # One-sided slopes, carried on from step to step and from round to round, find the way; two-sided ones
        # decide where it ends. Exact ones do both, once the weights are those of the noise.
        exact = exact or (exact_slopes and round_ > 0)
        borrowed = None if exact or slopes is None else problem.carried(slopes, weights)
        first = 1e-4 * scale if step is None else step
        derivative = FreeRunSlopes(problem, low, high, scale, first) if exact_slopes else None
        goal = _SETTLED if exact else near
        found = minimise(
            problem.residual, point, low, high, scale, step, quick=True, central=exact, leading=k, jacobian=borrowed,
            draft=True, max_iterations=_LAST_STEPS if exact and not criterion.whiten else _ITERATIONS_PER_ROUND,
            tolerance=0.5 * goal**2, derivative=derivative,
        )  # fmt: skip
        if not np.all(np.isfinite(found.jacobian)):
            raise IdloopError(
                "beside the values that the search has come to the model gives no finite output; give its parameters"
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
    """Whether exact slopes of free runs are those of differences where a search has ended.

    Parameters
    ----------
    found : Solution
        Of a `SimulationCriterion`.
    """
    slopes = FreeRunSlopes(found.problem, found.lower, found.upper, found.scale, found.step)
    return slopes.agree(np.concatenate([found.theta, found.nuisance]))


def _conditional_errors(jacobian: Array, parameters: int) -> Array:
    """Standard errors from the plain Hessian, to judge how far a step was."""
    hessian = jacobian.T @ jacobian
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    inverse = np.linalg.pinv(hessian / np.outer(size, size), rcond=1e-12, hermitian=True)
    return np.asarray((np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size)[:parameters])
