"""Student's t distribution for errors with outliers, such as reversals and lost samples."""

from __future__ import annotations

from math import exp, lgamma, log, pi

import numpy as np

from idloop.arrays import Array

# Degrees of freedom: an error of ten standard deviations costs as much as a normal one of four.
FREEDOM = 4.0
_CONSTANT = lgamma(0.5 * (FREEDOM + 1.0)) - lgamma(0.5 * FREEDOM) - 0.5 * log(FREEDOM * pi)
# Rounds of the search of a scale, change of its logarithm that ends it, and slope that a secant must have.
_MOST_ROUNDS, _SETTLED, _LEAST_SLOPE = 50, 1e-8, -0.05


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
    before: tuple[float, float] | None = None
    for _ in range(_MOST_ROUNDS):
        weight = (FREEDOM + 1.0) / (FREEDOM + square / variance)
        updated = max(float(weight @ square) / number, 1e-300)
        change = log(updated / variance)
        if abs(change) <= _SETTLED:
            return float(np.sqrt(updated))
        at, move = log(variance), change
        if before is not None and at != before[0]:
            # The rounds of expectation and maximisation converge slowly: a secant to where they change nothing.
            slope = (change - before[1]) / (at - before[0])
            if slope < _LEAST_SLOPE:
                move = -change / slope
        before, variance = (at, change), exp(at + move)
    return float(np.sqrt(variance))


def log_density(errors: Array, scale: float) -> Array:
    """Log-density of each error."""
    tail = np.log1p((errors / scale) ** 2 / FREEDOM)
    return np.asarray(_CONSTANT - log(scale) - 0.5 * (FREEDOM + 1.0) * tail)
