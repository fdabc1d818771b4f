"""Autoregressive whitening of residuals, one model common to all records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
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
        m = self.order
        if m == 0:
            return series
        if series.shape[1] == 1:
            taps = np.concatenate([[1.0], -self.coefficients[:, 0, 0]])
            return np.asarray(np.convolve(series[:, 0], taps, mode="valid")[:, None])
        white: Array = series[m:].copy()
        n = len(series)
        for k, matrix in enumerate(self.coefficients, start=1):
            white -= series[m - k : n - k] @ matrix.T
        return white


def _covariances(records: list[Array], order: int) -> Array:
    """Pooled autocovariance matrices E e_t e_{t−k}ᵀ, k = 0..order, biased estimate."""
    p = records[0].shape[1]
    total = sum(len(e) for e in records)
    covariance = np.zeros((order + 1, p, p))
    for e in records:
        n = len(e)
        for k in range(min(order, n - 1) + 1):
            covariance[k] += e[k:].T @ e[: n - k]
    return np.asarray(covariance / total)


def _solve(covariance: Array, order: int) -> tuple[Array, Array]:
    """Yule-Walker solution and innovation covariance for one order."""
    p = covariance.shape[1]
    if order == 0:
        return np.zeros((0, p, p)), covariance[0]
    big = np.empty((order * p, order * p))
    for i in range(order):
        for j in range(order):
            lag = j - i
            block = covariance[lag] if lag >= 0 else covariance[-lag].T
            big[i * p : (i + 1) * p, j * p : (j + 1) * p] = block
    right = np.concatenate([covariance[k] for k in range(1, order + 1)], axis=1)
    # The ridge only matters for residuals that are exactly dependent, such as rounding-free data.
    big[np.diag_indices_from(big)] *= 1.0 + 1e-10
    stacked = np.linalg.lstsq(big.T, right.T, rcond=1e-14)[0].T
    innovation = covariance[0] - stacked @ right.T
    coefficients = stacked.reshape(p, order, p).transpose(1, 0, 2)
    return np.ascontiguousarray(coefficients), 0.5 * (innovation + innovation.T)


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
    return Whitener(_solve(_covariances(records, order), order)[0])


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
    for order in [k for k in _ORDERS if k <= most]:
        sign, log_determinant = np.linalg.slogdet(_solve(covariance, order)[1])
        if sign <= 0:
            break
        value = total * log_determinant + 2.0 * order * p * p
        if value < best:
            best, chosen = value, order
    return chosen
