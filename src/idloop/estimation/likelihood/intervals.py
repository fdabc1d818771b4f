"""Standard errors of a refit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.statistics.parameter_covariance import problem_covariance
from idloop.physics.model import Model
from idloop.records import Record


def with_stderr(fit: Refit, records: Sequence[Record]) -> Model:
    """The fitted model with the standard errors of its free parameters, for the reader.

    Parameters
    ----------
    fit : Refit
    records : sequence of Record
        What it was fitted to.
    """
    spread = np.sqrt(np.maximum(np.diag(parameter_covariance(fit)), 0.0))
    names = fit.model.free
    values = {name: float(v) for name, v in zip(names, fit.point, strict=False)}
    errors = {name: float(s) for name, s in zip(names, spread, strict=True) if np.isfinite(s)}
    return fit.model.with_values(values, errors)


def parameter_covariance(fit: Refit) -> NDArray[np.float64]:
    """Covariance of the free parameters of a fit by prediction or simulation, for errors of any colour.

    Returns
    -------
    array, shape (k, k)
        In the order of ``fit.model.free``; not finite where the data do not tell.
    """
    k, jacobian = fit.parameters, fit.jacobian
    jacobian = jacobian[:, (np.arange(jacobian.shape[1]) < k) | fit.felt]
    return np.asarray(problem_covariance(fit.problem, fit.point, fit.residual(), jacobian)[:k, :k])
