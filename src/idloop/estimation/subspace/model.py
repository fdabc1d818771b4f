"""From A, C and the Kalman gain to a model: B and D by least squares on the outputs, units and innovations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from idloop.arrays import Array, Complex
from idloop.errors import IdloopError
from idloop.estimation.linear.least_squares import solve
from idloop.estimation.linear.model import LinearModel, error_covariance, instability_notes
from idloop.estimation.linear.sensitivity import Matrices, compressed_errors
from idloop.estimation.statistics.collinear import collinearity_notes
from idloop.estimation.subspace.compression import Compression, innovation_sizes, triangular

_BLOCK = 4096  # samples taken in at once
_WORST_MODES = 1e5  # condition of the eigenvectors beyond which modes carry too few digits
_SMALLEST_SHARE = 1e-5  # of a regressor that must be independent of those before it
_RANK = 1e-12  # of the moments of the first state's responses


@dataclass(frozen=True)
class ModalFit:
    """What the regression found, in scaled units."""

    b: Array  # shape (n, m)
    d: Array  # shape (p, m)
    covariance: Array  # shape (p, p): mean product of the errors, the first state of each experiment estimated


@njit(cache=True, fastmath={"contract", "reassoc"})
def _filtered(
    poles: Any, seen: Any, into: Any, modes: Any, estimate: Any, inputs: Array, outputs: Array
) -> Array:  # fmt: skip
    """Rows (modes of each command, free modes, commands, errors without B and D), shape (N, 2 (m + 1) n + m + p).

    A mode takes two places, its real and its imaginary part. `modes` (m + 1, n) and `estimate` (n,) go on in place.
    """
    samples, m, p, n = len(inputs), inputs.shape[1], outputs.shape[1], len(poles)
    rows = np.empty((samples, 2 * (m + 1) * n + m + p))
    last = 2 * (m + 1) * n
    for t in range(samples):
        row = rows[t]
        for group in range(m + 1):
            drive = inputs[t, group] if group < m else 0.0
            for k in range(n):
                row[2 * (group * n + k)] = modes[group, k].real
                row[2 * (group * n + k) + 1] = modes[group, k].imag
                modes[group, k] = poles[k] * modes[group, k] + drive
        for k in range(n):  # what has died away would go on as numbers too small to be fast
            if abs(modes[m, k].real) + abs(modes[m, k].imag) < 1e-60:
                modes[m, k] = 0.0
        for j in range(m):
            row[last + j] = inputs[t, j]
        for q in range(p):
            error = outputs[t, q]
            for k in range(n):
                error -= (seen[q, k] * estimate[k]).real
            row[last + m + q] = error
        for k in range(n):
            estimate[k] *= poles[k]
            for q in range(p):
                estimate[k] += into[k, q] * outputs[t, q]
    return rows


def modal_regression(a: Array, c: Array, gain: Array, compression: Compression, feedthrough: bool) -> ModalFit | None:
    """Fit B, D and the first states to the outputs predicted with A, C and K."""
    poles, vectors = (np.asarray(part, dtype=complex) for part in np.linalg.eig(a - gain @ c))
    upper = poles.imag >= 0.0
    # A pair of modes in real coordinates: x + i y times the eigenvector above the axis.
    pairs = zip(poles[upper], vectors.T[upper], strict=True)
    parts = [[v.real, -v.imag] if pole.imag > 0.0 else [v.real] for pole, v in pairs]
    basis = np.array([column for part in parts for column in part]).T
    if basis.shape != a.shape or not np.linalg.cond(basis) < _WORST_MODES:
        return None
    n, m, p = len(a), compression.inputs, compression.outputs
    seen, into = c @ vectors, np.linalg.solve(vectors, gain.astype(complex))
    columns = _columns(seen, np.linalg.solve(vectors, basis.astype(complex)), m, feedthrough)
    wanted = len(columns) - n  # B and D; the first states come last
    square, right, whole, kept = np.zeros((wanted, wanted)), np.zeros(wanted), np.zeros(wanted), []
    for one in compression.experiments:
        moments = _moments(
            poles, seen, into, one.input / compression.input_scale, one.output / compression.output_scale
        )
        if moments is None:
            return None
        products = np.einsum("qpa,ab,rpb->qr", columns, moments[:-p, :-p], columns, optimize=True)
        against = np.einsum("qpa,ap->q", columns, moments[:-p, -p:])
        # The first state of each experiment is eliminated from its share.
        first = np.linalg.pinv(products[wanted:, wanted:], rcond=_RANK, hermitian=True)
        mixed = products[wanted:, :wanted]
        square += products[:wanted, :wanted] - mixed.T @ first @ mixed
        whole += np.diagonal(products)[:wanted]
        right += against[:wanted] - mixed.T @ first @ against[wanted:]
        kept.append((moments, first, mixed, against[wanted:]))
    if not np.all(np.diagonal(square) > _SMALLEST_SHARE**2 * whole):  # hardly more than what a first state explains
        return None
    factor = triangular(square)
    if factor is None or np.min(innovation_sizes(factor)) < _SMALLEST_SHARE:
        return None
    found = np.linalg.solve(factor.T, np.linalg.solve(factor, right))
    rest = np.zeros((p, p))
    for moments, first, mixed, against in kept:
        weights = np.einsum("q,qpa->pa", np.concatenate([found, first @ (against - mixed @ found)]), columns)
        across = weights @ moments[:-p, -p:]
        rest += moments[-p:, -p:] - across - across.T + weights @ moments[:-p, :-p] @ weights.T
    d = found[n * m :].reshape(p, m) if feedthrough else np.zeros((p, m))
    # In the predictor the command enters by B - K D.
    b = basis @ found[: n * m].reshape(m, n).T + gain @ d
    return ModalFit(b, d, rest / compression.samples)


def _columns(seen: Complex, coordinates: Complex, m: int, feedthrough: bool) -> Array:
    """Outputs' response to each unknown as weights of the rows, shape (unknowns, p, 2 (m + 1) n + m).

    The unknowns are B and the first state in the modes' real coordinates, with D between them.
    """
    p, n = seen.shape
    weights = np.einsum("pk,ki->ipk", seen, coordinates)
    # The real part of weight times mode.
    one = np.stack([weights.real, -weights.imag], axis=-1).reshape(n, p, 2 * n)
    direct = p * m if feedthrough else 0
    columns = np.zeros((m * n + direct + n, p, 2 * (m + 1) * n + m))
    for group in range(m):
        columns[group * n : (group + 1) * n, :, 2 * group * n : 2 * (group + 1) * n] = one
    columns[m * n + direct :, :, 2 * m * n : 2 * (m + 1) * n] = one
    for index in range(direct):
        columns[m * n + index, index // m, 2 * (m + 1) * n + index % m] = 1.0
    return columns


def _moments(poles: Complex, seen: Complex, into: Complex, inputs: Array, outputs: Array) -> Array | None:
    """Sum of the outer products of the filtered rows of one experiment; none where they overflow."""
    state, estimate = np.zeros((inputs.shape[1] + 1, len(poles)), dtype=complex), np.zeros(len(poles), dtype=complex)
    state[-1] = 1.0
    total: Array = np.zeros(())
    with np.errstate(all="ignore"):
        for start in range(0, len(outputs), _BLOCK):
            part = slice(start, start + _BLOCK)
            rows = _filtered(poles, seen, into, state, estimate, inputs[part], outputs[part])
            total = total + rows.T @ rows
    return total if np.all(np.isfinite(total)) else None


def command_matrices(
    compression: Compression, a: Array, c: Array, gain: Array, feedthrough: bool
) -> tuple[Array, Array, Array | None]:
    """B and D that make the predicted outputs closest to the measured ones, first states included.

    For given A, C and K the prediction is linear in B, D and the first state (Ljung, System Identification, 2nd ed.,
    eq. 10.127); with a zero gain it is the free run.

    `a`, `c`, `gain` (n, n), (p, n), (n, p): in scaled units; `feedthrough`: whether D is estimated; else it is zero.
    Returns `b, d` (n, m), (p, m); `covariance` (p, p): of the errors in scaled units, where they came out on the way.
    Raises IdloopError: the response overflows: an unstable model without a Kalman gain.
    """
    n, m, p = len(a), compression.inputs, compression.outputs
    if compression.squared:  # moments carry enough digits
        fit = modal_regression(a, c, gain, compression, feedthrough)
        if fit is not None:
            return fit.b, fit.d, fit.covariance
    base = Matrices(a, np.zeros((n, m)), c, np.zeros((p, m)), gain)
    count = n * m + (p * m if feedthrough else 0)
    everything = np.zeros((base.flat().size, count))
    everything[n * n : n * n + n * m, : n * m] = np.eye(n * m)
    at_d = n * n + n * m + p * n
    everything[at_d : at_d + p * m, n * m :] = np.eye(p * m, count - n * m)
    residual, jacobian = compressed_errors(base, base.like(everything), compression.scaled(), np.eye(p))
    if not np.all(np.isfinite(residual)):
        raise IdloopError("the model found is unstable and its free run overflows; add --stable, in Python stable=True")
    found = base.like(everything @ -solve(jacobian, residual, 1e-12))
    return found.b, found.d, None


def assembled(
    method: str,
    compression: Compression,
    matrices: Matrices,
    singular_values: Array,
    feedthrough: bool,
    notes: tuple[str, ...],
    covariance: Array | None = None,
) -> LinearModel:
    """Model in the signals' own units; its innovation covariance is that of its errors on the data."""
    first = compression.experiments[0]
    n, m, p = len(matrices.a), compression.inputs, compression.outputs
    command, measure = compression.input_scale, compression.output_scale
    notes += instability_notes(matrices.a)
    model = LinearModel(
        method, matrices.a, matrices.b / command, matrices.c * measure[:, None],
        matrices.d * measure[:, None] / command, matrices.gain / measure,
        np.zeros((p, p)) if covariance is None else covariance * np.outer(measure, measure),
        **first.labels,
        samples=compression.samples,
        # Of all entries n squared are the choice of the states' coordinates.
        free=n * (m + p) + p * m * feedthrough + n * p * bool(np.any(matrices.gain)),
        singular_values=singular_values,
        notes=notes,
    )  # fmt: skip
    if covariance is None:
        model = replace(model, covariance=error_covariance(model, compression.experiments))
    return replace(model, notes=(*model.notes, *collinearity_notes(compression.experiments, model)))
