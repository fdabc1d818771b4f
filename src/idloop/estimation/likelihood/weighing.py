"""The log-likelihood of a problem, with its noise model at its best for a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.optimisation.problem import Problem

Array = NDArray[np.float64]


def log_likelihood(problem: Problem) -> float:
    """Concentrated log-likelihood of a problem at the point at which it has just been weighed."""
    value = 0.0
    for instants, order, weight in zip(problem.instants, problem.orders, problem.weights, strict=True):
        value += instants * float(np.sum(np.log(np.diag(weight)))) - order * len(weight) ** 2
    return value if np.isfinite(value) else -np.inf


def weigh(problem: Problem, point: Array, orders: list[int] | None = None) -> float:
    """Choose the noise model at a point, and return the log-likelihood there; minus infinity where there is none.

    Parameters
    ----------
    problem : Problem
        Keeps the noise model.
    point : array, shape (k + m,)
        Free parameters, then nuisance parameters.
    orders : list of int, optional
        Orders of the whitening, one for each group of outputs; chosen by the errors when left out.
    """
    with np.errstate(all="ignore"):
        try:
            problem.reweigh(point, True, orders)
            return log_likelihood(problem)
        except (np.linalg.LinAlgError, IdloopError):
            return -np.inf


def residual_or_infinite(problem: Problem, point: Array) -> Array:
    """Residual, infinite where the model cannot be simulated."""
    try:
        return problem.frozen_residual(point)
    except (IdloopError, np.linalg.LinAlgError):
        return np.full(problem.length, np.inf)


def projected(problem: Problem, point: Array) -> Array:
    """Residual with the whitening at its best for the point, infinite where there is none."""
    try:
        return problem.residual(point)
    except (IdloopError, np.linalg.LinAlgError):
        return np.full(problem.length, np.inf)
