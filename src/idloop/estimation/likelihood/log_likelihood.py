"""Concentrated log-likelihood of a least-squares problem: its noise model is the best one for each point."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.statistics.whitening import autocovariances, fit_whitener, left_by_orders


def weigh(problem: LeastSquaresProblem, point: Array, orders: list[int] | None = None) -> float:
    """Fit the noise model at a point and return the log-likelihood there; minus infinity where there is none.

    One unit is subtracted for each parameter of the noise model.

    `problem`: keeps the noise model.
    `point` (k + m,): free parameters, then nuisance parameters.
    `orders`: whitening orders, one for each group of outputs; chosen from the errors when left out.
    """
    with np.errstate(all="ignore"):
        try:
            problem.reweigh(point, True, orders)
        except (np.linalg.LinAlgError, IdloopError):
            return -np.inf
        value = 0.0
        for instants, order, weight in zip(problem.instants, problem.orders, problem.weights, strict=True):
            value += instants * float(np.sum(np.log(np.diag(weight)))) - order * len(weight) ** 2
        return value if np.isfinite(value) else -np.inf


def start_log_likelihood(problem: LeastSquaresProblem, point: Array) -> float:
    """Log-likelihood of the first instants of all records, beyond that of average instants.

    The whitening has no complete past for them; each is predicted by the autoregression of as many lags as it has
    (Levinson's lower orders). Only these instants show a constant force beside a random-walk disturbance.

    `problem`: with the noise model of the point.
    `point` (k + m,).
    Returns: 0 without whitening, and for criteria other than innovations.
    """
    criterion = problem.criterion
    if not isinstance(criterion, InnovationCriterion) or not any(problem.orders):
        return 0.0
    nuisance, value = point[problem.parameters :], 0.0
    for place, (group, order) in enumerate(zip(problem.errors(point), problem.orders, strict=True)):
        left = left_by_orders(autocovariances(group, order))
        average = 0.5 * float(np.linalg.slogdet(left[-1])[1])
        for lag in range(min(order, len(left))):
            coefficients, deviation = fit_whitener(group, lag).coefficients, np.linalg.cholesky(left[lag])
            for record, errors in enumerate(group):
                error = errors[lag] - np.einsum("kij,kj->i", coefficients, errors[:lag][::-1])
                white = np.linalg.solve(deviation, error)
                value += average - float(np.sum(np.log(np.diag(deviation))))
                value += 0.5 * (len(white) - float(white @ white))
                value += criterion.start_scaling(nuisance, record, place, lag)
    return value if np.isfinite(value) else 0.0
