"""Least squares between rows that may be linearly dependent: bases, complements and regressions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrtri

Array = NDArray[np.float64]

# Rows of unit deviation come out of the compression with rounding of some 1e-14.
RANK_TOLERANCE = 1e-11


def row_basis(rows: Array, size: float | None = None) -> Array:
    """Orthonormal basis of the row space, shape (rank, columns).

    `rows` (r, columns); `size`: norm against which a direction counts as zero; the largest singular value by default.
    """
    if rows.shape[0] <= rows.shape[1]:
        # Where no row depends on the others, which its triangle tells, the quicker way gives the same span.
        basis, triangle = np.linalg.qr(rows.T)
        if _independent(triangle, size):
            return np.asarray(basis.T)
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(basis[_kept(values, size)])


def project(rows: Array, basis: Array) -> Array:
    """Part of `rows` in the span of an orthonormal basis."""
    return np.asarray((rows @ basis.T) @ basis)


def regress(target: Array, regressors: Array, size: float | None = None) -> Array:
    """Coefficients X of smallest norm that make X times `regressors` closest to `target`, shape (t, r).

    `target`, `regressors` (t, columns), (r, columns); `size`: as for `row_basis`.
    """
    if regressors.shape[0] <= regressors.shape[1]:
        basis, triangle = np.linalg.qr(regressors.T)
        if _independent(triangle, size):
            return np.asarray(solve_triangular(triangle, (target @ basis).T).T)
    left, values, basis = np.linalg.svd(regressors, full_matrices=False)
    kept = _kept(values, size)
    return np.asarray((target @ basis[kept].T / values[kept]) @ left[:, kept].T)


def _independent(triangle: Array, size: float | None) -> bool:
    """Whether every singular value of an upper triangle counts, for less than the values cost; no in doubt."""
    inverse, singular = dtrtri(triangle)
    if singular:
        return False
    largest = size if size is not None else float(np.linalg.norm(triangle))
    return bool(RANK_TOLERANCE * largest * np.linalg.norm(inverse) < 1.0)  # the norm of an inverse is 1 / smallest


def _kept(values: Array, size: float | None) -> NDArray[np.bool_]:
    largest = size if size is not None else float(np.max(values, initial=0.0))
    return np.asarray((values > RANK_TOLERANCE * largest) & (values > 0.0))
