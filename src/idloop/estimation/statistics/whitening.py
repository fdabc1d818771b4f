"""Autoregressive whitening of residuals, with one model for all records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.observer.small_matrices import (
    assign,
    multiply,
    multiply_transposed,
    solve_from_right,
    subtract,
    symmetrise,
)

Array = NDArray[np.float64]

_ORDERS = (0, 1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 30)


@dataclass(frozen=True)
class Whitener:
    """Vector autoregression ``e_t = Σ A_k e_{t−k} + w_t``."""

    coefficients: Array  # shape (order, p, p): A_1..A_order

    @property
    def order(self) -> int:
        """Number of lags."""
        return len(self.coefficients)

    def apply(self, series: Array) -> Array:
        """Whitened residuals (n − order, p) of one record (n, p) without NaN, without rows that lack a full past."""
        if self.order == 0:
            return series
        return np.asarray(_filter(np.ascontiguousarray(series), np.ascontiguousarray(self.coefficients)))


@njit(cache=True, nogil=True, fastmath=True)
def _filter(series: Any, coefficients: Any) -> Any:
    """Prediction errors of an autoregression."""
    n, p = series.shape
    order = coefficients.shape[0]
    # Contiguous in time, so that the compiler vectorises the sums.
    past = series.T.copy()
    white = past[:, order:].copy()
    for j in range(p):
        to = white[j]
        for k in range(1, order + 1):
            for q in range(p):
                factor = coefficients[k - 1, j, q]
                late = past[q, order - k : n - k]
                for i in range(n - order):
                    to[i] -= factor * late[i]
    return white.T.copy()


@njit(cache=True, nogil=True, fastmath=True)
def _lagged_products(series: Any, total: Any) -> None:
    """Add Σ e_t e_{t−k}ᵀ of one record, k = 0..order, to ``total`` (order + 1, p, p)."""
    n, p = series.shape
    by_output = series.T.copy()
    for k in range(min(total.shape[0], n)):
        for j in range(p):
            now = by_output[j, k:]
            for q in range(p):
                late = by_output[q, : n - k]
                sum_ = 0.0
                for i in range(n - k):
                    sum_ += now[i] * late[i]
                total[k, j, q] += sum_


def autocovariances(records: list[Array], order: int) -> Array:
    """Pooled autocovariance matrices E e_t e_{t−k}ᵀ, k = 0..order, biased estimate."""
    p = records[0].shape[1]
    covariance = np.zeros((order + 1, p, p))
    for e in records:
        _lagged_products(np.ascontiguousarray(e), covariance)
    return np.asarray(covariance / sum(len(e) for e in records))


@njit(cache=True, nogil=True, error_model="numpy")
def _levinson(covariance: Any, innovation: Any) -> Any:
    """Yule-Walker solutions of all orders in turn, each from the one before.

    Whittle, "On the fitting of multivariate autoregressions", Biometrika 50, 1963.

    `covariance` (order + 1, p, p): autocovariances of lag 0..order; `innovation` (order + 1, p, p): receives the
    residual covariance of each order. Returns shape (k, p, p): A_1..A_k of the highest order; k is lower where the
    covariance becomes singular.
    """
    order, p = covariance.shape[0] - 1, covariance.shape[1]
    ahead, back = np.zeros((order, p, p)), np.zeros((order, p, p))
    before_ahead, before_back = ahead.copy(), back.copy()
    left_ahead, left_back = covariance[0].copy(), covariance[0].copy()
    for i in range(p):  # for exactly dependent residuals, such as data without rounding
        left_ahead[i, i] += 1e-10 * covariance[0, i, i]
        left_back[i, i] = left_ahead[i, i]
    assign(left_ahead, innovation[0])
    last_ahead, last_back, factor = np.empty((p, p)), np.empty((p, p)), np.zeros((p, p))
    part = np.empty((p, p))
    for k in range(1, order + 1):
        missing = covariance[k].copy()
        for i in range(k - 1):
            multiply(ahead[i], covariance[k - 1 - i], part)
            subtract(part, missing)
        assign(missing, last_ahead)
        solve_from_right(left_back, factor, last_ahead)
        assign(missing.T, last_back)
        solve_from_right(left_ahead, factor, last_back)
        if not (np.all(np.isfinite(last_ahead)) and np.all(np.isfinite(last_back))):
            return ahead[: k - 1]
        for i in range(k - 1):
            assign(ahead[i], before_ahead[i])
            assign(back[i], before_back[i])
        for i in range(k - 1):
            multiply(last_ahead, before_back[k - 2 - i], part)
            subtract(part, ahead[i])
            multiply(last_back, before_ahead[k - 2 - i], part)
            subtract(part, back[i])
        assign(last_ahead, ahead[k - 1])
        assign(last_back, back[k - 1])
        multiply_transposed(last_ahead, missing, part)
        subtract(part, left_ahead)
        multiply(last_back, missing, part)
        subtract(part, left_back)
        symmetrise(left_ahead)
        symmetrise(left_back)
        assign(left_ahead, innovation[k])
    return ahead


def left_by_orders(covariance: Array) -> Array:
    """Residual covariances of autoregressions of all orders.

    `covariance` (order + 1, p, p): autocovariances of lag 0..order, see `autocovariances`. Returns shape (k + 1, p, p):
    of the orders 0..k; k is lower than ``order`` where the covariance becomes singular.
    """
    innovation = np.empty_like(covariance)
    return innovation[: len(_levinson(covariance, innovation)) + 1]


def fit_whitener(records: list[Array], order: int) -> Whitener:
    """Vector autoregression of a given order by the Yule-Walker equations.

    `records` (n_r, p): residuals of each record, without NaN; `order`: number of lags. Returns: a stable
    autoregression, by biased autocovariances; further lags are zero where the covariance becomes singular.
    """
    covariance = autocovariances(records, order)
    coefficients = np.zeros((order, *covariance.shape[1:]))
    found = _levinson(covariance, np.empty_like(covariance))
    coefficients[: len(found)] = found
    return Whitener(coefficients)


def choose_order(records: list[Array], limit: int | None = None) -> int:
    """Order of the autoregression by Akaike's criterion, at most ``limit``; 0 for white or too short residuals.

    `records` (n_r, p): residuals of each record, without NaN; `limit`: largest order tried.
    """
    p = records[0].shape[1]
    total = sum(len(e) for e in records)
    shortest = min(len(e) for e in records)
    most = min(_ORDERS[-1], shortest // 20, total // (20 * p * p))
    most = most if limit is None else min(most, limit)
    if most < 1:
        return 0
    covariance = autocovariances(records, most)
    innovation = left_by_orders(covariance)
    orders = np.array([order for order in _ORDERS if order < len(innovation)])
    sign, log_determinant = np.linalg.slogdet(innovation[orders])
    # No order above the first singular covariance.
    sound = np.logical_and.accumulate(sign > 0)
    if not sound[0]:
        return 0
    value = total * log_determinant + 2.0 * orders * p * p
    return int(orders[np.argmin(np.where(sound, value, np.inf))])
