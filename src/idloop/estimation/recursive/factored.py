"""A covariance as U D U^T, so that it stays symmetric and positive whatever rounding does, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def measured(upper: Array, diagonal: Array, direction: Array, noise: float, gain: Array) -> float:
    """Take in one scalar measurement: P becomes P - P h h^T P / (h^T P h + r), in O(k^2).

    Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, section V.3.

    `upper` (k, k): unit upper triangular U, changed in place; `diagonal` (k,): D, changed in place; `direction` (k,):
    h; `noise`: r, above 0; `gain` (k,): receives P h / (h^T P h + r). Returns: h^T P h + r with the P from before.
    """
    size = len(diagonal)
    total = noise
    for j in range(size):
        along = direction[j]
        for i in range(j):
            along += upper[i, j] * direction[i]
        share = diagonal[j] * along
        before = total
        total = before + along * share
        diagonal[j] *= before / total
        gain[j] = share
        for i in range(j):
            old = upper[i, j]
            upper[i, j] = old - gain[i] * along / before
            gain[i] += old * share
    for j in range(size):
        gain[j] /= total
    return total


@njit(cache=True, nogil=True)
def widened(upper: Array, diagonal: Array, index: int, variance: float, work: Array) -> None:
    """Add to the variance of one coefficient, in O(k^2) (rank-one update of Agee and Turner, 1972).

    `upper`, `diagonal` (k, k), (k,): changed in place; `variance`: 0 or more; `work` (k,).
    """
    work[:] = 0.0
    work[index] = 1.0
    rest = variance
    for j in range(index, -1, -1):
        own = work[j]
        new = diagonal[j] + rest * own * own
        if new <= 0.0:
            continue
        factor = rest / new
        rest = factor * diagonal[j]
        diagonal[j] = new
        for i in range(j):
            work[i] -= own * upper[i, j]
            upper[i, j] += factor * own * work[i]


@njit(cache=True, nogil=True)
def propagated(upper: Array, diagonal: Array, moved: Array, noise: Array, work: Array) -> None:
    """Take a step in time: P becomes F P F^T + Q with a diagonal Q, in O(k^3).

    Weighted Gram-Schmidt orthogonalization of Thornton (Bierman, 1977, section VI.4).

    `upper`, `diagonal` (k, k), (k,): changed in place; `moved` (k, k): F U; used up; `noise` (k,): diagonal of Q, 0 or
    more; `work` (k, k + 1).
    """
    size = len(diagonal)
    own, old = work[:, :size], work[:, size]
    own[:] = 0.0
    for i in range(size):
        own[i, i] = 1.0
        old[i] = diagonal[i]
    upper[:] = 0.0
    for j in range(size - 1, -1, -1):
        total = 0.0
        for k in range(size):
            total += moved[j, k] * moved[j, k] * old[k] + own[j, k] * own[j, k] * noise[k]
        diagonal[j] = total
        upper[j, j] = 1.0
        if total <= 0.0:
            continue
        for i in range(j):
            product = 0.0
            for k in range(size):
                product += moved[i, k] * moved[j, k] * old[k] + own[i, k] * own[j, k] * noise[k]
            share = product / total
            upper[i, j] = share
            for k in range(size):
                moved[i, k] -= share * moved[j, k]
                own[i, k] -= share * own[j, k]


@njit(cache=True, nogil=True)
def variances(upper: Array, diagonal: Array, result: Array) -> None:
    """Diagonal of U D U^T into `result`, shape (k,)."""
    size = len(diagonal)
    for i in range(size):
        total = diagonal[i]
        for j in range(i + 1, size):
            total += upper[i, j] * upper[i, j] * diagonal[j]
        result[i] = total


@njit(cache=True, nogil=True)
def limited(upper: Array, diagonal: Array, variance: Array, most: Array) -> None:
    """Shrink the coefficients whose variance is above its limit to it, correlations kept.

    What is not excited would otherwise grow without end under forgetting (covariance wind-up); what is excited
    goes on forgetting.

    `upper`, `diagonal` (k, k), (k,): changed in place; `variance` (k,): of `variances`; changed in place; `most` (k,).
    """
    size = len(diagonal)
    for i in range(size):
        if variance[i] > most[i]:
            factor = np.sqrt(most[i] / variance[i])
            for j in range(i + 1, size):
                upper[i, j] *= factor
            for j in range(i):
                upper[j, i] /= factor
            diagonal[i] *= factor * factor
            variance[i] = most[i]
