"""Autoregressive whitening of residuals, one model common to all records."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ORDERS = (0, 1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 30)


@dataclass(frozen=True)
class Whitener:
    """Vector autoregression ``e_t = Σ A_k e_{t−k} + w_t``.

    Attributes
    ----------
    coefficients : array, shape (order, p, p)
        A_1..A_order.
    """

    coefficients: Array

    @property
    def order(self) -> int:
        """Number of lags."""
        return len(self.coefficients)

    def apply(self, series: Array) -> Array:
        """Whiten one record.

        Parameters
        ----------
        series : array, shape (n, p)
            Residuals without NaN.

        Returns
        -------
        array, shape (n − order, p)
            Whitened residuals; the first ``order`` rows have no full past and are dropped.
        """
        if self.order == 0:
            return series
        return np.asarray(_filter(np.ascontiguousarray(series), np.ascontiguousarray(self.coefficients)))


@njit(cache=True, nogil=True, fastmath=True)
def _filter(series: Any, coefficients: Any) -> Any:
    """Prediction errors of an autoregression."""
    n, p = series.shape
    order = coefficients.shape[0]
    # One series after the other in memory: sums along time then run several at once.
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


def _covariances(records: list[Array], order: int) -> Array:
    """Pooled autocovariance matrices E e_t e_{t−k}ᵀ, k = 0..order, biased estimate."""
    p = records[0].shape[1]
    covariance = np.zeros((order + 1, p, p))
    for e in records:
        _lagged_products(np.ascontiguousarray(e), covariance)
    return np.asarray(covariance / sum(len(e) for e in records))


def _levinson(covariance: Array) -> Iterator[tuple[Array, Array]]:
    """Yule-Walker solutions of all orders in turn, each from the one before.

    Whittle, "On the fitting of multivariate autoregressions", Biometrika 50, 1963.

    Parameters
    ----------
    covariance : array, shape (order + 1, p, p)
        Autocovariances of lag 0..order.

    Yields
    ------
    coefficients : array, shape (k, p, p)
        A_1..A_k of order k = 0..order.
    innovation : array, shape (p, p)
        Covariance of what is left.
    """
    p = covariance.shape[1]
    # The ridge only matters for residuals that are exactly dependent, such as rounding-free data.
    start = covariance[0] + 1e-10 * np.diag(np.diag(covariance[0]))
    ahead, back = np.zeros((0, p, p)), np.zeros((0, p, p))
    left_ahead, left_back = start, start
    yield ahead, left_ahead
    for k in range(1, len(covariance)):
        missing = covariance[k] - np.einsum("iab,ibc->ac", ahead, covariance[k - 1 : 0 : -1])
        try:
            last_ahead = np.linalg.solve(left_back.T, missing.T).T
            last_back = np.linalg.solve(left_ahead.T, missing).T
        except np.linalg.LinAlgError:
            return  # what is left is nothing: no higher order can say more
        ahead, back = (
            np.concatenate([ahead - last_ahead @ back[::-1], last_ahead[None]]),
            np.concatenate([back - last_back @ ahead[::-1], last_back[None]]),
        )
        left_ahead = left_ahead - last_ahead @ missing.T
        left_back = left_back - last_back @ missing
        left_ahead, left_back = 0.5 * (left_ahead + left_ahead.T), 0.5 * (left_back + left_back.T)
        yield ahead, left_ahead


def fit_whitener(records: list[Array], order: int) -> Whitener:
    """Vector autoregression of a given order by the Yule-Walker equations.

    Parameters
    ----------
    records : list of arrays, shape (n_r, p)
        Residuals of each record, without NaN.
    order : int
        Number of lags.

    Returns
    -------
    Whitener
        A stable autoregression (the biased autocovariances see to that).
    """
    *_, (coefficients, _) = _levinson(_covariances(records, order))
    return Whitener(np.ascontiguousarray(coefficients))


def choose_order(records: list[Array], limit: int | None = None) -> int:
    """Order of the autoregression by Akaike's criterion.

    Parameters
    ----------
    records : list of arrays, shape (n_r, p)
        Residuals of each record, without NaN.
    limit : int, optional
        Largest order tried.

    Returns
    -------
    int
        Order; 0 for residuals that are white already or too short to tell.
    """
    p = records[0].shape[1]
    total = sum(len(e) for e in records)
    shortest = min(len(e) for e in records)
    most = min(_ORDERS[-1], shortest // 20, total // (20 * p * p))
    most = most if limit is None else min(most, limit)
    if most < 1:
        return 0
    covariance = _covariances(records, most)
    best, chosen = np.inf, 0
    for coefficients, innovation in _levinson(covariance):
        order = len(coefficients)
        sign, log_determinant = np.linalg.slogdet(innovation)
        if sign <= 0:
            break
        if order not in _ORDERS:
            continue
        value = total * log_determinant + 2.0 * order * p * p
        if value < best:
            best, chosen = value, order
    return chosen
