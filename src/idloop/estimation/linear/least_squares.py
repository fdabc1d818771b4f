"""Least squares on columns of any unit, and on more rows than the memory holds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError

_BLOCK = 8192  # rows that are factored at a time


def column_sizes(matrix: Array) -> Array:
    """Norms of the columns, shape (k,); 1 for a column of zeros."""
    sizes = np.linalg.norm(matrix, axis=0)
    return np.asarray(np.where(sizes == 0.0, 1.0, sizes))


def solve(matrix: Array, target: Array, rank: float | None = None) -> Array:
    """Least squares in units of the columns, of smallest norm in them where the rows leave something open.

    `rank`: singular values below this part of the largest are rounding.
    """
    sizes = column_sizes(matrix)
    found = np.linalg.lstsq(matrix / sizes, target, rcond=rank)[0]
    return np.asarray((found.T / sizes).T)


def triangle(blocks: Iterable[Array]) -> Array:
    """Triangular factor (k, k) of the QR factorisation of blocks (n_i, k) of rows on top of each other.

    It has the lengths and the inner products of the columns.
    """
    factor: Array | None = None
    for block in blocks:
        stacked = block if factor is None else np.vstack([factor, block])
        factor = np.asarray(np.linalg.qr(stacked, mode="r"))
    if factor is None:
        raise InputError("no rows to fit; give more data or lower orders")
    missing = max(factor.shape[1] - factor.shape[0], 0)
    return np.vstack([factor, np.zeros((missing, factor.shape[1]))])


def rows_in_blocks(length: int, first: int) -> Iterator[tuple[int, int]]:
    """Ranges of rows small enough to be factored in the cache."""
    for start in range(first, length, _BLOCK):
        yield start, min(start + _BLOCK, length)
