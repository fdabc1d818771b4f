"""Student's t distribution for errors with outliers, such as reversals and lost samples."""

from __future__ import annotations

from math import lgamma, log, pi

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Degrees of freedom: an error of ten standard deviations costs as much as a normal one of four.
FREEDOM = 4.0
_CONSTANT = lgamma(0.5 * (FREEDOM + 1.0)) - lgamma(0.5 * FREEDOM) - 0.5 * log(FREEDOM * pi)
_MOST_ROUNDS, _SETTLED = 50, 1e-8


def weights(standardised: Array) -> Array:
    """Weight of each error, given over the scale: about 1 for small ones, falling with the square of large ones."""
    return np.asarray((FREEDOM + 1.0) / (FREEDOM + standardised**2))


def scale_of(errors: Array, count: float | None = None) -> float:
    """Maximum-likelihood scale of errors, positive.

    `errors` (n,). `count`: number of errors whose density contains the scale; all when left out.
    """
    square = errors**2
    number = len(square) if count is None else max(count, 1e-9)
    variance = max(float(np.sum(square)) / number, 1e-300)
    for _ in range(_MOST_ROUNDS):
        weight = (FREEDOM + 1.0) / (FREEDOM + square / variance)
        updated = max(float(weight @ square) / number, 1e-300)
        settled = abs(updated - variance) <= _SETTLED * variance
        variance = updated
        if settled:
            break
    return float(np.sqrt(variance))


def log_density(errors: Array, scale: float) -> Array:
    """Log-density of each error."""
    tail = np.log1p((errors / scale) ** 2 / FREEDOM)
    return np.asarray(_CONSTANT - log(scale) - 0.5 * (FREEDOM + 1.0) * tail)
