"""What the first instants of records say, which a whitening of many lags leaves out for want of a past.

A constant force shows beside a disturbance that walks in these instants alone: from there on the disturbance stands for
it. An autoregression has a past of its own for each of them, a shorter one (Levinson's lower orders).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.problem import Problem
from idloop.estimation.statistics.whitening import autocovariances, fit_whitener, left_by_orders

Array = NDArray[np.float64]


def start_log_likelihood(problem: Problem, point: Array) -> float:
    """Log-likelihood of the instants that the whitening has spent as its past, beyond that of average ones.

    Parameters
    ----------
    problem : Problem
        As it was last weighed.
    point : array, shape (k + m,)
        Where it was weighed.

    Returns
    -------
    float
        0 without whitening, and for criteria other than innovations.
    """
    criterion = problem.criterion
    if not isinstance(criterion, InnovationCriterion) or not any(problem.orders):
        return 0.0
    nuisance, value = point[problem.parameters :], 0.0
    for place, (group, order) in enumerate(zip(problem.errors(point), problem.orders, strict=True)):
        left = left_by_orders(autocovariances(group, order))
        average = 0.5 * float(np.linalg.slogdet(left[-1])[1])
        for lag in range(min(order, len(left))):
            # One order for one instant of each record: whoever comes later has a longer past.
            coefficients, deviation = fit_whitener(group, lag).coefficients, np.linalg.cholesky(left[lag])
            for record, errors in enumerate(group):
                past = errors[:lag][::-1]
                error = errors[lag] - np.einsum("kij,kj->i", coefficients, past)
                rest = np.linalg.solve(deviation, error)
                value += average - float(np.sum(np.log(np.diag(deviation))))
                value += 0.5 * (len(rest) - float(rest @ rest)) + criterion.start_scaling(nuisance, record, place, lag)
    return value if np.isfinite(value) else 0.0
