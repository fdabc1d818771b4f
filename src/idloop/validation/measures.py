"""Measures of fit per output: RMSE, NRMSE and FIT."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import InputError

# Negligible error relative to the deviation of an output: 0.002 points of FIT.
NEGLIGIBLE = 2e-5
# Relative error of what explains half of the power.
HALF_OF_POWER = 0.5**0.5


def _columns(measured: ArrayLike, modelled: ArrayLike) -> tuple[Array, Array]:
    y = np.asarray(measured, dtype=float)
    y_hat = np.asarray(modelled, dtype=float)
    if y.shape != y_hat.shape:
        raise InputError(
            f"measured output has shape {y.shape} and model output {y_hat.shape}; "
            "simulate the model at the measurement times"
        )
    if y.ndim == 1:
        y, y_hat = y[:, None], y_hat[:, None]
    # Samples that are NaN on either side are left out.
    known = np.isfinite(y) & np.isfinite(y_hat)
    return np.where(known, y, np.nan), np.where(known, y_hat, np.nan)


def _root_mean_square(values: Array) -> Array:
    count = np.sum(np.isfinite(values), axis=0)
    total = np.nansum(values**2, axis=0)
    return np.asarray(np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan)))


def rmse(measured: ArrayLike, modelled: ArrayLike) -> Array:
    """Root mean square error of every output.

    `measured`, `modelled` (n,) or (n, p): measured and model output in the output's unit; NaN samples are left out.
    Returns shape (p,): RMSE in the output's unit; NaN where an output was never measured. Raises InputError: if the
    shapes differ.
    """
    y, y_hat = _columns(measured, modelled)
    return _root_mean_square(y - y_hat)


def nrmse(measured: ArrayLike, modelled: ArrayLike) -> Array:
    """Error norm over the norm of the measured output about its mean.

    `measured`, `modelled` (n,) or (n, p): measured and model output; NaN samples are left out. Returns shape (p,): ``‖y
    − ŷ‖ / ‖y − mean y‖``, dimensionless (0.12 is a FIT of 88 %); infinite for an error of a constant output, NaN where
    nothing was measured. Raises InputError: if the shapes differ.
    """
    y, y_hat = _columns(measured, modelled)
    count = np.maximum(np.sum(np.isfinite(y), axis=0), 1)
    spread = _root_mean_square(y - np.nansum(y, axis=0) / count)
    error = _root_mean_square(y - y_hat)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = error / spread
    # A constant output that is matched exactly has an error of 0, not 0 / 0.
    return np.asarray(np.where(error == 0.0, 0.0, ratio))


def fit_percent(measured: ArrayLike, modelled: ArrayLike) -> Array:
    """FIT of every output in percent: ``100 (1 − ‖y − ŷ‖ / ‖y − mean y‖)``.

    `measured`, `modelled` (n,) or (n, p): measured and model output; NaN samples are left out. Returns shape (p,): FIT
    in percent: 100 is perfect, 0 is as good as the mean, below 0 is worse. Raises InputError: if the shapes differ.
    """
    return np.asarray(100.0 * (1.0 - nrmse(measured, modelled)))


def measures(names: tuple[str, ...], measured: ArrayLike, modelled: ArrayLike) -> dict[str, Any]:
    """All three measures as plain numbers by output name, ready for JSON.

    `names`: output names, for example ``("motor.position",)``; `measured`, `modelled` (n, p): measured and model
    output. Returns: ``{"fit": {name: percent}, "nrmse": {name: ratio}, "rmse": {name: value}}``; ``None`` where a
    measure is not finite, as JSON has no NaN.
    """
    table = {
        "fit": fit_percent(measured, modelled),
        "nrmse": nrmse(measured, modelled),
        "rmse": rmse(measured, modelled),
    }
    return {
        key: {name: (float(value) if np.isfinite(value) else None) for name, value in zip(names, row, strict=True)}
        for key, row in table.items()
    }
