"""Scaling of the regressors, learnt from the training data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FLAT = 1e-13  # spread of a column over its mean that is rounding


def by_range(values: Array) -> tuple[Array, Array]:
    """Centre and half width of the range of each column; the half width of a constant column is 1.

    `values` (n, c). Returns `center, width` (c,).
    """
    low, high = np.min(values, axis=0), np.max(values, axis=0)
    width = 0.5 * (high - low)
    return 0.5 * (low + high), np.where(width > 0, width, 1.0)


def by_spread(values: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of each column; the standard deviation of a constant column is given as 1.

    `values` (n, c). Returns `center, width` (c,).
    """
    center = np.mean(values, axis=0)
    width = np.std(values, axis=0)
    # Rounding of the mean makes a constant column seem to move.
    return center, np.where(width > _FLAT * np.abs(center), width, 1.0)
