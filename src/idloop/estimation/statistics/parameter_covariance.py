"""How far the estimate of a problem may be off, from its residuals at the solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.statistics.covariance import jackknife, sandwich, white_covariance, widest

if TYPE_CHECKING:
    from idloop.estimation.optimisation.problem import Problem

Array = NDArray[np.float64]

_STRETCHES = 40  # of the data, that the jackknife leaves out one by one


def problem_covariance(problem: Problem, point: Array, residual: Array, jacobian: Array) -> Array:
    """Covariance of the point at which a problem was solved.

    Parameters
    ----------
    problem : Problem
        With the weights of the solution.
    point : array, shape (m,)
    residual : array, shape (n,)
        In units of its standard deviation.
    jacobian : array, shape (n, m)

    Returns
    -------
    array, shape (m, m)
        NaN in the rows and columns of parameters that move nothing.
    """
    told = np.any(jacobian != 0.0, axis=0)
    told_of = jacobian[:, told]
    covariance = np.full((len(told), len(told)), np.nan)
    # Each of the three is too small somewhere in short records, none is too large by much.
    covariance[np.ix_(told, told)] = widest(
        [
            sandwich(told_of.T @ told_of, problem.scores(point, residual, told_of)),
            white_covariance(told_of),
            jackknife(told_of, residual, problem.stretches(point, _STRETCHES)),
        ]
    )
    return covariance
