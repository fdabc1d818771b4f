"""Standard errors of a refit."""

from __future__ import annotations

import numpy as np

from idloop.diagnose.refit import Refit
from idloop.estimate.covariance import sandwich, white_covariance, widest
from idloop.estimate.levenberg import difference_jacobian
from idloop.physics.model import Model


def with_stderr(fit: Refit) -> Model:
    """The fitted model with the standard errors of its free parameters.

    Parameters
    ----------
    fit : Refit

    Returns
    -------
    Model
    """
    problem, point, k = fit.problem, fit.point, fit.parameters
    lower, upper = fit.model.bounds
    _, low, high, size = fit.criterion.nuisance()
    residual = fit.residual()
    scale = np.concatenate([np.maximum(np.abs(point[:k]), 1e-12), size])
    jacobian, _ = difference_jacobian(
        problem.frozen_residual, point, residual, np.concatenate([lower, low]), np.concatenate([upper, high]),
        fit.step, scale,
    )  # fmt: skip
    scores = problem.scores(point, residual, jacobian)
    covariance = widest([sandwich(jacobian.T @ jacobian, scores), white_covariance(jacobian)])
    spread = np.sqrt(np.maximum(np.diag(covariance)[:k], 0.0))
    names = fit.model.free
    values = {name: float(v) for name, v in zip(names, point, strict=False)}
    errors = {name: float(s) for name, s in zip(names, spread, strict=True) if np.isfinite(s)}
    return fit.model.with_values(values, errors)
