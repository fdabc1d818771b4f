"""Products and factors of small matrices for compiled loops, in which a library call costs more than the product.

Assignments too: for one of arrays numba compiles all that forms the message of a wrong shape, a second each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from idloop.estimation.compiled import inner


@inner
def assign(a: Any, out: Any) -> None:
    """The matrix A into `out`."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i, j] = a[i, j]


@inner
def subtract(a: Any, out: Any) -> None:
    """The matrix A from `out`."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i, j] -= a[i, j]


@inner
def symmetrise(a: Any) -> None:
    """The mean of A and A' into A."""
    for i in range(a.shape[0]):
        for j in range(i, a.shape[1]):
            a[i, j] = a[j, i] = 0.5 * (a[i, j] + a[j, i])


@inner
def multiply(a: Any, b: Any, out: Any) -> None:
    """Matrix product A B into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for n in range(a.shape[1]):
                total += a[i, n] * b[n, j]
            out[i, j] = total


@inner
def multiply_transposed(a: Any, b: Any, out: Any) -> None:
    """Matrix product A B' into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            total = 0.0
            for n in range(a.shape[1]):
                total += a[i, n] * b[j, n]
            out[i, j] = total


@inner
def solve_from_right(a: Any, factor: Any, b: Any) -> None:
    """Replace the rows of `b` by B A^-1, A symmetric and positive; `factor` takes its Cholesky factor."""
    p = a.shape[0]
    cholesky(a, factor)
    for row in range(b.shape[0]):
        for i in range(p):
            total = b[row, i]
            for n in range(i):
                total -= factor[i, n] * b[row, n]
            b[row, i] = total / factor[i, i]
        for back in range(p):
            i = p - 1 - back
            total = b[row, i]
            for n in range(i + 1, p):
                total -= factor[n, i] * b[row, n]
            b[row, i] = total / factor[i, i]


@inner
def cholesky(a: Any, factor: Any) -> None:
    """Lower Cholesky factor of a positive matrix into `factor`, whose upper part is left as it is."""
    for i in range(a.shape[0]):
        for j in range(i + 1):
            total = a[i, j]
            for n in range(j):
                total -= factor[i, n] * factor[j, n]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
