"""The search for the least prediction errors: several starts, Levenberg-Marquardt, well-scaled coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.optimisation.levenberg import minimise
from idloop.estimation.polynomial.channels import Channel
from idloop.estimation.polynomial.objective import Objective
from idloop.estimation.polynomial.regression import inverse_factor, rows_in_blocks, triangle

Array = NDArray[np.float64]

_RESTARTS = 5  # starts that are followed
_DRAFT_ROWS = 20_000  # samples on which rival starts are compared
_ROUNDS = 8
_FLAT = 1e-11  # directions that change the errors by less than this part of the steepest are rounding
_FLOOR = 1e-11  # errors below this part of the output are rounding


@dataclass(frozen=True, eq=False)
class Found:
    """Where the search ended."""

    free: Array  # shape (r,): free coefficients
    squares: float  # sum of squared errors
    converged: bool


@dataclass(frozen=True, eq=False)
class Information:
    """What the data say of the coefficients at the minimum."""

    factor: Array  # shape (r, s): W with W W^T the inverse of the sum of psi psi^T
    undetermined: NDArray[np.bool_]  # shape (r,): coefficients that the data leave open
    scores: list[Array]  # shape (n_i, s): psi(t)^T W e(t) of each experiment


def best(objective: Objective, starts: Sequence[Array]) -> Found:
    """Follow the most promising starts to their minima and keep the lowest.

    `starts` (r,): free coefficients. Raises IdloopError: when no start gives a predictor that stays finite.
    """
    draft = _shortened(objective)
    valued = sorted(
        ((value, index) for index, s in enumerate(starts) if np.isfinite(value := _squares(draft, s))),
    )
    if not valued:
        raise IdloopError("no stable predictor of these orders was found; try other orders or delays")
    # Starts of the same error are the same start.
    distinct = [valued[0], *(b for a, b in pairwise(valued) if b[0] > (1.0 + 1e-6) * a[0])]
    ends = [_descend(draft, starts[index], rounds=2) for _, index in distinct[:_RESTARTS]]
    lowest = min(ends, key=lambda end: end.squares)
    return _descend(objective, lowest.free, rounds=_ROUNDS)


def information(objective: Objective, free: Array) -> Information:
    """Information, what it leaves open, and the scores for standard errors that hold under coloured errors."""
    coefficients = objective.coefficients(free)
    slopes = objective.slopes(coefficients)
    factor, undetermined = inverse_factor(_triangle(slopes))
    errors = objective.errors(coefficients)
    scores = [(jacobian @ factor) * error[:, None] for jacobian, error in zip(slopes, errors, strict=True)]
    return Information(factor, undetermined, scores)


def _descend(objective: Objective, start: Array, rounds: int) -> Found:
    """Levenberg-Marquardt in coordinates of one standard error each, which are renewed until they hold."""
    free, squares = start, _squares(objective, start)
    size = float(np.sqrt(sum(float(c.output @ c.output) for c in objective.data)))
    converged = False
    for _ in range(rounds):
        sigma = float(np.sqrt(squares / max(objective.rows, 1)))
        if np.sqrt(squares) <= _FLOOR * size:
            return Found(free, squares, True)
        axes = _axes(_triangle(objective.slopes(objective.coefficients(free)))) * sigma
        centre, unbounded = free, np.full(axes.shape[1], np.inf)

        def residual(z: Array, centre: Array = centre, axes: Array = axes, sigma: float = sigma) -> Array:
            return np.concatenate(objective.errors(objective.coefficients(centre + axes @ z))) / sigma

        def slope(z: Array, centre: Array = centre, axes: Array = axes, sigma: float = sigma) -> Array:
            stacked = np.vstack(objective.slopes(objective.coefficients(centre + axes @ z)))
            return np.asarray(stacked @ (axes / sigma))

        end = minimise(
            residual, np.zeros(len(unbounded)), -unbounded, unbounded, np.ones(len(unbounded)),
            max_iterations=25, derivative=slope, tolerance=1e-6,
        )  # fmt: skip
        before, squares = squares, min(2.0 * end.cost * sigma**2, squares)
        free = centre + axes @ end.point
        # Errors that shrank have a finer unit, in which the search goes on.
        converged = end.converged
        if converged and before - squares <= 1e-3 * before / max(objective.rows, 1):
            break
        if not converged and before - squares <= 1e-9 * before:
            break
    return Found(free, squares, converged)


def _axes(factor: Array) -> Array:
    """Directions in which the errors change by one unit each; what the errors do not feel stays where it is."""
    scale = np.linalg.norm(factor, axis=0)
    scale[scale == 0.0] = 1.0
    _, values, right = np.linalg.svd(factor / scale, full_matrices=False)
    keep = values > _FLAT * max(float(values[0]), 1e-300)
    return np.asarray((right[keep].T / values[keep]) / scale[:, None])


def _triangle(slopes: Sequence[Array]) -> Array:
    return triangle(s[first:last] for s in slopes for first, last in rows_in_blocks(len(s), 0))


def _squares(objective: Objective, free: Array) -> float:
    value = sum(float(e @ e) for e in objective.errors(objective.coefficients(free)))
    return value if np.isfinite(value) else np.inf


def _shortened(objective: Objective) -> Objective:
    """The same objective on the first part of long experiments."""
    total = sum(len(c.output) for c in objective.data)
    if total <= 2 * _DRAFT_ROWS:
        return objective
    share = _DRAFT_ROWS / total
    least = 20 * (objective.start + objective.orders.size)
    cut = [max(int(share * len(c.output)), min(least, len(c.output))) for c in objective.data]
    data = [Channel(c.output[:n], c.inputs[:n]) for c, n in zip(objective.data, cut, strict=True)]
    shorter = Objective(data, objective.orders, objective.initial, objective.spread, objective.offset)
    # The roots must stay where the whole record allows them.
    shorter.plant_limit, shorter.noise_limit = objective.plant_limit, objective.noise_limit
    return shorter
