"""Standard errors of a refit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.refit import Refit, felt
from idloop.diagnose.weighing import residual_or_infinite
from idloop.estimate.levenberg import difference_jacobian
from idloop.estimate.spread import problem_covariance
from idloop.physics.model import Model
from idloop.records import Record


def with_stderr(fit: Refit, records: Sequence[Record]) -> Model:
    """The fitted model with the standard errors of its free parameters, for the reader.

    Parameters
    ----------
    fit : Refit
    records : sequence of Record
        What it was fitted to.

    Returns
    -------
    Model
    """
    spread = np.sqrt(np.maximum(np.diag(parameter_covariance(fit)), 0.0))
    names = fit.model.free
    values = {name: float(v) for name, v in zip(names, fit.point, strict=False)}
    errors = {name: float(s) for name, s in zip(names, spread, strict=True) if np.isfinite(s)}
    return fit.model.with_values(values, errors)


def parameter_covariance(fit: Refit) -> NDArray[np.float64]:
    """Covariance of the free parameters of a fit by prediction or simulation, for errors of any colour.

    Parameters
    ----------
    fit : Refit

    Returns
    -------
    array, shape (k, k)
        In the order of ``fit.model.free``; not finite where the data do not tell.
    """
    problem, point, k = fit.problem, fit.point, fit.parameters
    lower, upper = fit.model.bounds
    _, low, high, size = fit.criterion.nuisance()
    residual = fit.residual()
    scale = np.concatenate([np.maximum(np.abs(point[:k]), 1e-12), size])
    jacobian, _ = difference_jacobian(
        lambda at: residual_or_infinite(problem, at),
        point,
        residual,
        np.concatenate([lower, low]),
        np.concatenate([upper, high]),
        fit.step,
        scale,
    )
    jacobian[:, ~np.all(np.isfinite(jacobian), axis=0)] = 0.0
    jacobian = jacobian[:, (np.arange(jacobian.shape[1]) < k) | felt(jacobian, k, size)]
    return np.asarray(problem_covariance(problem, point, residual, jacobian)[:k, :k])
