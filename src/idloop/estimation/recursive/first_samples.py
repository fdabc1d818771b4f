"""What the first samples tell a filter: coefficients to start from, and how large the noise is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.polynomial.orders import Orders

Array = NDArray[np.float64]


class Start(NamedTuple):
    """Values in the units of the signals.

    `vector`, `stderr` (k,): coefficients of A and B, and standard errors; `process`, `measurement`: variance of the
    equation error and of the measurement noise, if all noise were that [output unit squared].
    """

    vector: Array
    stderr: Array
    process: float
    measurement: float


def start_from(inputs: Array, outputs: Array, orders: Orders) -> Start | None:
    """Fit an ARMAX model by two least squares, and take the variance of A y - B u from it.

    A long ARX model gives the innovations, which are regressors of the second fit (Hannan and Rissanen,
    Biometrika 69, 1982). White noise on the measurement passes through A, white noise in the equation does not.

    `inputs`, `outputs` (n, m), (n,): NaN where nothing was measured; `orders`: of A and B. Returns: none where there
    are too few samples.
    """
    size = max(orders.na, *orders.nb, 1)
    held = [_held(inputs[:, i]) for i in range(orders.inputs)]
    scale = np.array([_size(one) for one in (*held, outputs)])
    y, u = outputs / scale[-1], [one / by for one, by in zip(held, scale, strict=False)]
    # So many lags that what is left is white, and few enough for the samples.
    count = min(max(2 * size + 2, len(y) // (6 * (orders.inputs + 1))), 10 * size)
    lags = range(1, count + 1)
    long = [_late(y, k) for k in lags] + [_late(u[i], nk + k) for i, nk in enumerate(orders.nk) for k in range(count)]
    fitted = _least_squares(np.column_stack(long), y)
    if fitted is None:
        return None
    errors = fitted[1]
    short = [-_late(y, k) for k in range(1, orders.na + 1)]
    short += [_late(u[i], nk + k) for i, nk in enumerate(orders.nk) for k in range(orders.nb[i])]
    short += [_late(errors, k) for k in range(1, size + 1)]
    fitted = _least_squares(np.column_stack(short), y)
    if fitted is None:
        return None
    vector, left, stderr = fitted
    known = np.isfinite(left)
    a, c = (np.zeros(size + 1) for _ in range(2))
    a[0] = c[0] = 1.0
    a[1 : orders.na + 1], c[1:] = vector[: orders.na], vector[orders.size :]
    process = float(np.mean(left[known] ** 2) * (c @ c))
    measurement = process / float(a @ a)
    unit = np.ones(orders.size)
    for i in range(orders.inputs):
        unit[orders.b(i)] = scale[-1] / scale[i]
    free = orders.size
    return Start(vector[:free] * unit, stderr[:free] * unit, process * scale[-1] ** 2, measurement * scale[-1] ** 2)


def _held(signal: Array) -> Array:
    """The signal with the value before in the place of each that is missing, 0 before the first."""
    known = np.isfinite(signal)
    last = np.maximum.accumulate(np.where(known, np.arange(len(signal)), -1))
    return np.where(last >= 0, np.where(known, signal, 0.0)[last], 0.0)


def _size(signal: Array) -> float:
    known = signal[np.isfinite(signal)]
    size = float(np.sqrt(np.mean(known**2))) if np.any(known) else 0.0
    return size if size > 0.0 else 1.0


def _late(signal: Array, lag: int) -> Array:
    return np.concatenate([np.full(min(lag, len(signal)), np.nan), signal[: max(len(signal) - lag, 0)]])


def _least_squares(rows: Array, y: Array) -> tuple[Array, Array, Array] | None:
    """Solution, errors of every sample (NaN where unknown) and standard errors."""
    known = np.isfinite(y) & np.all(np.isfinite(rows), axis=1)
    spare = int(np.sum(known)) - rows.shape[1]
    if spare < rows.shape[1] // 2 + 5:
        return None
    solution = np.linalg.lstsq(rows[known], y[known], rcond=None)[0]
    errors = np.where(known, y - np.where(np.isfinite(rows), rows, 0.0) @ solution, np.nan)
    variance = float(np.sum(errors[known] ** 2)) / spare
    stderr = np.sqrt(variance * np.maximum(np.diag(np.linalg.pinv(rows[known].T @ rows[known])), 0.0))
    # Of a command that has not come yet nothing is known, though the pseudo-inverse has 0 there.
    stderr[np.all(rows[known] == 0.0, axis=0)] = np.inf
    return solution, errors, stderr
