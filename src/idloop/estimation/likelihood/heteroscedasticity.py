"""Errors that vary more, or hang together longer, where an effect leaves its trace than elsewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Stretches of the errors whose sums say how far their serial correlation reaches.
_STRETCHES = 60
# Ratio of variances that sixty stretches of white errors hardly ever show.
_SERIAL = 1.4


def stretches(rows: int) -> NDArray[np.int64]:
    """First row of each stretch whose sums say how far the errors' serial correlation reaches."""
    return np.unique(np.linspace(0, rows, _STRETCHES + 1).astype(np.int64)[:-1])


def unevenness(directions: Array, errors: Array) -> float:
    """How much more errors vary along directions than elsewhere, at least 1.

    Parameters
    ----------
    directions : array, shape (n, g)
        Orthonormal.
    errors : array, shape (n,)
        Without what they have along the directions.
    """
    variance = max(float(np.mean(errors**2)), 1e-300)
    uneven = max(1.0, float(np.max((directions**2).T @ errors**2)) / variance)
    # Where a trace runs slowly, a faint colour of the errors adds up that no whitening has seen.
    sums = np.add.reduceat(directions * errors[:, None], stretches(len(errors)), axis=0)
    serial = float(np.max(np.sum(sums**2, axis=0))) / variance
    return max(uneven, serial) if serial > _SERIAL else uneven
