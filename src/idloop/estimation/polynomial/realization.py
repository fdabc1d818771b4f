"""Innovation-form state space of polynomial models, in observer form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Realization:
    """x(k+1) = A x + B u + K e, y = C x + D u + e.

    `a`, `b`, `c`, `d`, `gain` (n, n), (n, m), (p, n), (p, m), (n, p).
    """

    a: Array
    b: Array
    c: Array
    d: Array
    gain: Array


def observer_form(denominator: Array, numerators: Sequence[Array]) -> tuple[Array, Array, Array, Array]:
    """State space of y = sum_i N_i(q) / P(q) v_i (Ljung, System Identification, 2nd ed., eq. 4.87 to 4.90).

    `denominator`: P, coefficients of 1, q^-1, ...; the first is 1; `numerators`: N_i, coefficients of 1, q^-1, .
    Returns `a, b, c, d` (n, n), (n, m), (1, n), (1, m).
    """
    order = max([len(denominator), *(len(n) for n in numerators)]) - 1
    low = np.zeros(order + 1)
    low[: len(denominator)] = denominator
    high = np.zeros((order + 1, len(numerators)))
    for index, numerator in enumerate(numerators):
        high[: len(numerator), index] = numerator
    a = np.eye(order, k=1)
    if order:
        a[:, 0] -= low[1:]
    b = high[1:] - np.outer(low[1:], high[0])
    return a, b, np.eye(1, order), high[:1].copy()


def general_form(a: Array, b: Sequence[Array], c: Array, d: Array, f: Sequence[Array]) -> Realization:
    """State space of A y = sum_i B_i / F_i u_i + C / D e for one output.

    `a`, `c`, `d`: polynomials, first coefficient 1; `b`, `f`: of each input; B with its delay as leading zeros.
    """
    # What has a denominator of its own is a subsystem in front; the rest drives 1/A directly.
    paths = [(num, den, column) for column, (num, den) in enumerate(zip(b, f, strict=True))] + [(c, d, len(b))]
    through = [np.ones(1) if len(den) > 1 else num for num, den, _ in paths]
    core = observer_form(a, through)
    parts = [(observer_form(den, [num]), column) for num, den, column in paths if len(den) > 1]
    order = core[0].shape[0] + sum(part[0].shape[0] for part, _ in parts)
    size, width = core[0].shape[0], len(paths)
    aa, bb, cc, dd = np.zeros((order, order)), np.zeros((order, width)), np.zeros((1, order)), np.zeros((1, width))
    aa[:size, :size], bb[:size], cc[:, :size], dd[:] = core
    first = size
    for (pa, pb, pc, pd), column in parts:
        rows = slice(first, first + pa.shape[0])
        aa[rows, rows], bb[rows, column] = pa, pb[:, 0]
        aa[:size, rows] = core[1][:, [column]] @ pc
        cc[:, rows] = core[3][0, column] * pc
        bb[:size, column] = core[1][:, column] * pd[0, 0]
        dd[0, column] = core[3][0, column] * pd[0, 0]
        first = rows.stop
    return Realization(aa, bb[:, :-1], cc, dd[:, :-1], bb[:, -1:])


def matrix_form(a: Array, b: Array) -> Realization:
    """State space of y(t) + A_1 y(t-1) + ... = B_0 u(t) + B_1 u(t-1) + ... + e(t), with matrices.

    `a` (na, p, p): A_1, A_2, ; `b` (nb, p, m): B_0, B_1, .
    """
    p, m = b.shape[1:]
    order = max(a.shape[0], b.shape[0] - 1)
    low, high = np.zeros((order, p, p)), np.zeros((order + 1, p, m))
    low[: a.shape[0]], high[: b.shape[0]] = a, b
    aa = np.eye(order * p, k=p)
    aa[:, :p] -= low.reshape(order * p, p)
    bb = (high[1:] - low @ high[0]).reshape(order * p, m)
    return Realization(aa, bb, np.eye(p, order * p), high[0], -low.reshape(order * p, p))


def stack(parts: Sequence[Realization]) -> Realization:
    """One model of several outputs from one model of each, side by side."""
    from scipy.linalg import block_diag

    return Realization(
        block_diag(*(part.a for part in parts)),
        np.vstack([part.b for part in parts]),
        block_diag(*(part.c for part in parts)),
        np.vstack([part.d for part in parts]),
        block_diag(*(part.gain for part in parts)),
    )
