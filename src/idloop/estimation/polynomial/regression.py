"""Linear least squares on lagged signals: one pass of QR over the record, whatever its length."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

Array = NDArray[np.float64]

_BLOCK = 8192  # rows that are factored at a time
# Singular values of the unit-column regressors below this part of the largest are rounding.
_RANK = 1e-13


def lagged(signal: Array, lags: Sequence[int], first: int, last: int | None = None) -> Array:
    """Columns signal(t - lag) for t = first..last-1; what lies before the record is 0.

    `signal` (n,); `lags`: 0 or more [samples]; `first`, `last`: rows. Returns shape (last - first, number of lags).
    """
    stop = len(signal) if last is None else last
    columns = np.zeros((stop - first, len(lags)))
    for column, lag in enumerate(lags):
        start = max(first, lag)
        if start < stop:
            columns[start - first :, column] = signal[start - lag : stop - lag]
    return columns


def triangle(blocks: Iterable[Array]) -> Array:
    """Triangular factor R of the QR factorisation of blocks of rows on top of each other.

    `blocks` (n_i, k). Returns shape (k, k): upper triangular, with the lengths and the inner products of the columns.
    """
    factor: Array | None = None
    for block in blocks:
        stacked = block if factor is None else np.vstack([factor, block])
        factor = np.asarray(np.linalg.qr(stacked, mode="r"))
    if factor is None:
        raise InputError("no rows to fit; give more data or lower orders")
    if factor.shape[0] < factor.shape[1]:
        factor = np.vstack([factor, np.zeros((factor.shape[1] - factor.shape[0], factor.shape[1]))])
    return np.asarray(factor)


@dataclass(frozen=True, eq=False)
class Solution:
    """Least-squares solution from a triangular factor.

    `factor` (k, r): W with W W^T the pseudo-inverse of the normal matrix, so that the covariance for white errors of
    variance v is v W W^T.
    """

    coefficients: Array  # shape (k,): of smallest norm (in units of the columns) where the data leave some undetermined
    squares: float  # sum of squares that is left
    factor: Array
    undetermined: NDArray[np.bool_]  # shape (k,): which coefficients the data leave open


def solve(factor: Array) -> Solution:
    """Solve for the last column of a triangular factor from the others.

    `factor` (k + 1, k + 1): of `triangle`, from the rows [regressors, target].
    """
    k = factor.shape[1] - 1
    inverse, undetermined = inverse_factor(factor[:k, :k])
    scale = _scale(factor[:k, :k])
    coefficients = np.linalg.lstsq(factor[:k, :k] / scale, factor[:k, k], rcond=_RANK * max(k, 1))[0] / scale
    left = factor[:k, k] - factor[:k, :k] @ coefficients
    return Solution(coefficients, float(left @ left + factor[k, k] ** 2), inverse, undetermined)


def inverse_factor(factor: Array) -> tuple[Array, NDArray[np.bool_]]:
    """W with W W^T the pseudo-inverse of R^T R, and which coordinates it leaves open.

    `factor` (n, k): R, or any matrix with as many columns as coefficients.
    """
    scale = _scale(factor)
    _, values, right = np.linalg.svd(factor / scale, full_matrices=False)
    keep = values > _RANK * max(float(values[0]) if len(values) else 0.0, 1e-300) * max(factor.shape[1], 1)
    missing = np.linalg.norm(right[~keep], axis=0) if not np.all(keep) else np.zeros(factor.shape[1])
    return right[keep].T / values[keep] / scale[:, None], np.asarray(missing > 1e-6)


def _scale(factor: Array) -> Array:
    scale = np.linalg.norm(factor, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(scale)


def rows_in_blocks(length: int, first: int) -> Iterator[tuple[int, int]]:
    """Ranges of rows small enough to be factored in the cache."""
    for start in range(first, length, _BLOCK):
        yield start, min(start + _BLOCK, length)
