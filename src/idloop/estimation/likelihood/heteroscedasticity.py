"""Heteroscedasticity and serial correlation of errors along the directions that an effect explains."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers

# Segments of the errors whose sums show the serial correlation.
_SEGMENTS = 60
# Ratio of variances that sixty segments of white errors hardly ever reach.
_SERIAL = 1.4


def segment_starts(rows: int) -> Integers:
    """First row of each segment whose sum shows the serial correlation."""
    return np.unique(np.linspace(0, rows, _SEGMENTS + 1).astype(np.int64)[:-1])


def heteroscedasticity(directions: Array, errors: Array) -> float:
    """Variance of the errors along some directions over their mean variance, at least 1.

    `directions` (n, g): orthonormal.
    `errors` (n,): orthogonal to the directions.
    """
    variance = max(float(np.mean(errors**2)), 1e-300)
    ratio = max(1.0, float(np.max((directions**2).T @ errors**2)) / variance)
    # Along a slow direction a weak correlation adds up that no whitening has found.
    sums = np.add.reduceat(directions * errors[:, None], segment_starts(len(errors)), axis=0)
    serial = float(np.max(np.sum(sums**2, axis=0))) / variance
    return max(ratio, serial) if serial > _SERIAL else ratio
