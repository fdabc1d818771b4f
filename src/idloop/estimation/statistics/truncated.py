"""Least squares in the directions that the data determine, by the Gram matrix of the regressors."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array


def directions(gram: Array, least: float) -> tuple[Array, Array]:
    """Right singular vectors of regressors, and their singular values, without the weak ones.

    By the Gram matrix, whose cost hardly grows with the rows; it resolves values above about 1e-7 of the largest.

    `gram` (k, k): regressors, transposed, times themselves.
    `least`: least singular value that is kept, as a part of the largest.
    Returns `vectors` (k, kept).
    and `values` (kept,): the strongest last.
    """
    power, vectors = np.linalg.eigh(gram)
    kept = power > max(least**2 * float(power[-1]), 1e-300)
    return vectors[:, kept], np.sqrt(power[kept])
