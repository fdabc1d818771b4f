"""Least squares between rows that may be linearly dependent: bases, projections, plain and ridge regressions."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrtri

from idloop.arrays import Array, Mask

# Rows of unit deviation come out of the compression with rounding of some 1e-14.
RANK_TOLERANCE = 1e-11
_STRENGTHS = np.geomspace(1e-12, 1e1, 131)  # in deviations of the regressors


def row_basis(rows: Array, size: float | None = None) -> Array:
    """Orthonormal basis of the row space, shape (rank, columns).

    `rows` (r, columns); `size`: norm against which a direction counts as zero; the largest singular value by default.
    """
    if rows.shape[0] <= rows.shape[1]:
        # Where no row depends on the others, as its triangular factor shows, QR gives the same span faster.
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
    """Whether an upper triangle has full numerical rank, without its singular values; false in doubt."""
    inverse, singular = dtrtri(triangle)
    if singular:
        return False
    largest = size if size is not None else float(np.linalg.norm(triangle))
    return bool(RANK_TOLERANCE * largest * np.linalg.norm(inverse) < 1.0)  # the norm of an inverse is 1 / smallest


def _kept(values: Array, size: float | None) -> Mask:
    largest = size if size is not None else float(np.max(values, initial=0.0))
    return np.asarray((values > RANK_TOLERANCE * largest) & (values > 0.0))


def evidence_regression(target: Array, regressors: Array, windows: int, floor: float) -> Array:
    """Coefficients of the ridge regression of greatest evidence, shape (t, r).

    Where the excitation leaves directions of the past nearly empty, least squares fills them with numbers that
    cancel in the data but not in a shifted window. A prior of zero mean on all coefficients keeps them small; its
    width maximises the marginal likelihood (MacKay, Neural Computation 4, 1992), so that it gives way to the data
    as these grow.

    `target`, `regressors` (t, columns), (r, columns): square roots of the second moments: rows of an LQ factor divided
    by the root of the number of windows; `windows`: observations behind the columns; `floor`: deviation of an error
    that counts as none.
    """
    left, values, basis = np.linalg.svd(regressors, full_matrices=False)
    explained = target @ basis.T
    rest = target - explained @ basis
    covariance = rest @ rest.T + floor**2 * np.eye(len(target))
    seen = np.linalg.solve(np.linalg.cholesky(covariance), explained)
    weight = np.sum(seen**2, axis=0)
    best, chosen = np.inf, _STRENGTHS[0]
    for strength in _STRENGTHS:
        # Minus twice the log of the evidence, without what all strengths share.
        spread = values**2 / strength**2
        criterion = len(target) * np.sum(np.log1p(spread)) + windows * np.sum(weight / (1.0 + spread))
        if criterion < best:
            best, chosen = criterion, strength
    return np.asarray((explained * (values / (values**2 + chosen**2))) @ left.T)
