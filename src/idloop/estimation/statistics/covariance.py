"""Covariance of estimates under coloured residuals: HAC sandwich, inverse Hessian and block jackknife."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Integers

if TYPE_CHECKING:
    from idloop.estimation.optimisation.least_squares import LeastSquaresProblem


# A segment alone determines a parameter when the others hold less than this part of the information on it.
_ALONE = 0.2
# Segments that the jackknife leaves out one by one.
_SEGMENTS = 40


def estimate_covariance(problem: LeastSquaresProblem, point: Array, residual: Array, jacobian: Array) -> Array:
    """Covariance of the solution of a least-squares problem: the widest of sandwich, inverse Hessian and jackknife.

    Each of the three is too small for some short records, and none is too large by much.

    `problem`: with the weights of the solution; `point` (m,); `residual` (n,): in units of its standard deviation;
    `jacobian` (n, m). Returns shape (m, m): NaN in the rows and columns of parameters without influence on the
    residual.
    """
    used = np.any(jacobian != 0.0, axis=0)
    columns = jacobian[:, used]
    covariance = np.full((len(used), len(used)), np.nan)
    covariance[np.ix_(used, used)] = widest(
        [
            sandwich(columns.T @ columns, problem.scores(point, residual, columns)),
            white_covariance(columns),
            jackknife(columns, residual, problem.segments(point, _SEGMENTS)),
        ]
    )
    return covariance


def long_run_covariance(records: list[Array]) -> Array:
    """Long-run covariance Σ_k E g_t g_{t−k}ᵀ of a vector series.

    Quadratic spectral kernel with the automatic bandwidth of Andrews (Econometrica 59, 1991), after prewhitening of
    each component by a first-order autoregression (Andrews and Monahan, Econometrica 60, 1992).

    `records` (n_r, k): series of each record, of mean zero. Returns shape (k, k): covariance of the sum over one
    sample; positive semidefinite.
    """
    k = records[0].shape[1]
    total = sum(len(g) for g in records)
    rho = _first_order(records)
    white = [g[1:] - g[:-1] * rho for g in records]
    again = _first_order(white)
    variance = sum(np.sum(w**2, axis=0) for w in white) / total
    length = min(len(w) for w in white)
    # Andrews (1991), eq. 6.4; the weights remove the components' units.
    scale = np.where(variance > 1e-150, 1.0 / np.maximum(variance, 1e-150) ** 2, 0.0)
    numerator = np.sum(scale * 4.0 * again**2 * variance**2 / (1.0 - again) ** 8)
    denominator = np.sum(scale * variance**2 / (1.0 - again) ** 4)
    alpha = float(numerator / denominator) if denominator > 0 else 0.0
    bandwidth = max(1.3221 * (alpha * total) ** 0.2, 1.0)
    omega = np.zeros((k, k))
    for w in white:
        omega += w.T @ w
    reach = int(min(length - 1, np.ceil(8.0 * bandwidth)))
    for lag in range(1, reach + 1):
        weight = _quadratic_spectral(lag / bandwidth)
        for w in white:
            product = w[lag:].T @ w[:-lag]
            omega += weight * (product + product.T)
    omega /= total
    colour = 1.0 / (1.0 - rho)
    return np.asarray(omega * np.outer(colour, colour))


def _first_order(records: list[Array]) -> Array:
    """First-order autocorrelation of each component, at most 0.97."""
    top = sum(np.sum(g[1:] * g[:-1], axis=0) for g in records)
    bottom = sum(np.sum(g**2, axis=0) for g in records)
    return np.asarray(np.clip(np.where(bottom > 0, top / np.maximum(bottom, 1e-300), 0), -0.97, 0.97))


def _quadratic_spectral(x: float) -> float:
    z = 6.0 * np.pi * x / 5.0
    return float(3.0 / z**2 * (np.sin(z) / z - np.cos(z)))


def sandwich(bread: Array, scores: list[Array]) -> Array:
    """Covariance of an estimate that solves Σ_t g_t(θ) = 0.

    `bread` (k, k): derivative of the summed scores, Σ ∂g/∂θ (the Gauss-Newton Hessian for least squares); `scores`
    (n_r, k): g_t of each record at the estimate. Returns shape (k, k): ``H⁻¹ Ω H⁻ᵀ``, Ω the long-run covariance of the
    scores, times the small-sample factor n / (n − k).
    """
    total = sum(len(g) for g in scores)
    k = bread.shape[0]
    # Parameters differ by many orders of magnitude: scale to unit diagonal.
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(bread)), 1e-300))
    inverse = np.linalg.pinv(bread * np.outer(scale, scale), rcond=1e-13)
    omega = long_run_covariance([g * scale for g in scores]) * total
    covariance = inverse @ omega @ inverse.T * np.outer(scale, scale)
    factor = total / max(total - k, 1)
    return np.asarray(factor * 0.5 * (covariance + covariance.T))


def white_covariance(jacobian: Array) -> Array:
    """Covariance (k, k) for white residuals of unit variance, the inverse Hessian, from a Jacobian (n, k)."""
    scale = 1.0 / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    scaled = jacobian * scale
    return np.asarray(np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True) * np.outer(scale, scale))


def jackknife(jacobian: Array, residual: Array, blocks: list[Integers]) -> Array:
    """Covariance by leaving out one segment of the data at a time, to first order.

    Unlike asymptotic formulas it accounts for information that lies in few segments, and for a noise model that was
    fitted to the same data (Künsch, Annals of Statistics 17, 1989; one-step form of Cook and Weisberg).

    `jacobian` (n, k). `residual` (n,): in units of its standard deviation. `blocks`: rows of each segment; together all
    rows. Returns shape (k, k): the variance is 0 for a parameter that one segment alone determines: the jackknife does
    not apply to it.
    """
    scale = 1.0 / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    scaled = jacobian * scale
    hessian = scaled.T @ scaled
    parts = [(scaled[rows], residual[rows]) for rows in blocks]
    left = np.linalg.pinv(hessian - np.stack([part.T @ part for part, _ in parts]), rcond=1e-9, hermitian=True)
    moved = np.einsum("bij,bj->bi", left, np.stack([part.T @ rest for part, rest in parts]))
    whole = np.diag(np.linalg.pinv(hessian, rcond=1e-13, hermitian=True))
    without = np.diagonal(left, axis1=1, axis2=2)
    # Less information is a larger variance; a smaller one belongs to a direction without any information left.
    alone = np.any((_ALONE * without > whole) | (without < _ALONE * whole), axis=0)
    moved[:, alone] = 0.0
    total = moved.T @ moved
    count = len(blocks)
    return np.asarray(total * (count - 1) / count * np.outer(scale, scale))


def widest(candidates: list[Array]) -> Array:
    """First of several covariances (k, k), with each variance raised to the largest of all; correlations are kept."""
    variances = np.array([np.maximum(np.diag(c), 0.0) for c in candidates])
    own = np.maximum(variances[0], 1e-300)
    factor = np.sqrt(np.max(variances, axis=0) / own)
    return np.asarray(candidates[0] * np.outer(factor, factor))
