"""From A, C and the Kalman gain to a model: B and D by least squares on the outputs, units and innovations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.linear.least_squares import solve
from idloop.estimation.linear.model import LinearModel, error_covariance, instability_notes
from idloop.estimation.linear.sensitivity import Matrices, compressed_errors
from idloop.estimation.statistics.collinear import collinearity_notes
from idloop.estimation.subspace.compression import Compression, innovation_sizes, triangular

Array = NDArray[np.float64]
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


@dataclass(frozen=True)
class _Modes:
    """A = basis D basis^-1, D of numbers and of blocks [[real, -imaginary], [imaginary, real]]."""

    # Shape (n,): of each eigenvalue; a conjugate pair takes two places that both hold the one above the axis
    real: Array
    imaginary: Array
    basis: Array  # shape (n, n)


@njit(cache=True, fastmath={"contract", "reassoc"})
def _filtered(
    real: Array, imaginary: Array, seen: Array, into: Array,
    modes: Array, estimate: Array, inputs: Array, outputs: Array,
) -> Array:  # fmt: skip
    """Rows (modes of each command, free modes, commands, errors without B and D), shape (N, (m + 1) n + m + p).

    `modes` (m + 1, n) and `estimate` (n,) go on in place.
    """
    samples, m, p, n = len(inputs), inputs.shape[1], outputs.shape[1], len(real)
    rows = np.empty((samples, (m + 1) * n + m + p))
    for t in range(samples):
        row = rows[t]
        for group in range(m + 1):
            for k in range(n):
                row[group * n + k] = modes[group, k]
        for j in range(m):
            row[(m + 1) * n + j] = inputs[t, j]
        for q in range(p):
            error = outputs[t, q]
            for k in range(n):
                error -= seen[q, k] * estimate[k]
            row[(m + 1) * n + m + q] = error
        for group in range(m + 1):
            drive = inputs[t, group] if group < m else 0.0
            own = modes[group]
            k = 0
            while k < n:
                if imaginary[k] == 0.0:
                    own[k] = real[k] * own[k] + drive
                    k += 1
                else:
                    x, y = own[k], own[k + 1]
                    own[k] = real[k] * x - imaginary[k] * y + drive
                    own[k + 1] = imaginary[k] * x + real[k] * y
                    k += 2
        for k in range(n):  # what has died away would go on as numbers too small to be fast
            if abs(modes[m, k]) < 1e-60:
                modes[m, k] = 0.0
        k = 0
        while k < n:
            x = estimate[k]
            if imaginary[k] == 0.0:
                estimate[k] = real[k] * x
                k += 1
            else:
                y = estimate[k + 1]
                estimate[k] = real[k] * x - imaginary[k] * y
                estimate[k + 1] = imaginary[k] * x + real[k] * y
                k += 2
        for k in range(n):
            for q in range(p):
                estimate[k] += into[k, q] * outputs[t, q]
    return rows


def modal_regression(a: Array, c: Array, gain: Array, compression: Compression, feedthrough: bool) -> ModalFit | None:
    """Fit B, D and the first states to the outputs predicted with A, C and K."""
    modes = _modes(a - gain @ c)
    if modes is None:
        return None
    n, m, p = len(a), compression.inputs, compression.outputs
    seen = np.ascontiguousarray(c @ modes.basis)
    into = np.asarray(np.linalg.solve(modes.basis, gain), dtype=float)
    columns = _columns(modes, seen, m, feedthrough)
    wanted = len(columns) - n  # B and D; the first states come last
    square, right, whole, parts = np.zeros((wanted, wanted)), np.zeros(wanted), np.zeros(wanted), []
    for one in compression.experiments:
        moments = _moments(modes, seen, into, one.input, one.output, compression.input_scale, compression.output_scale)
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
        parts.append((moments, first, mixed, against[wanted:]))
    if not np.all(np.diagonal(square) > _SMALLEST_SHARE**2 * whole):  # hardly more than what a first state explains
        return None
    factor = triangular(square)
    if factor is None or np.min(innovation_sizes(factor)) < _SMALLEST_SHARE:
        return None
    found = np.linalg.solve(factor.T, np.linalg.solve(factor, right))
    rest = np.zeros((p, p))
    for moments, first, mixed, against in parts:
        weights = np.einsum("q,qpa->pa", np.concatenate([found, first @ (against - mixed @ found)]), columns)
        across = weights @ moments[:-p, -p:]
        rest += moments[-p:, -p:] - across - across.T + weights @ moments[:-p, :-p] @ weights.T
    d = found[n * m :].reshape(p, m) if feedthrough else np.zeros((p, m))
    # In the predictor the command enters by B - K D.
    b = modes.basis @ found[: n * m].reshape(m, n).T + gain @ d
    return ModalFit(b, d, rest / compression.samples)


def _modes(a: Array) -> _Modes | None:
    """Real modal form; none where eigenvectors are nearly parallel."""
    values, vectors = np.linalg.eig(a)
    basis, real, imaginary = [], [], []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < 0.0:
            continue
        pair = value.imag > 0.0
        basis += [vector.real, -vector.imag] if pair else [vector.real]
        real += [value.real] * (1 + pair)
        imaginary += [value.imag] * (1 + pair)
    matrix = np.ascontiguousarray(np.array(basis).T, dtype=float)
    if matrix.shape != a.shape or not np.linalg.cond(matrix) < _WORST_MODES:
        return None
    return _Modes(np.array(real), np.array(imaginary), matrix)


def _columns(modes: _Modes, seen: Array, m: int, feedthrough: bool) -> Array:
    """Outputs' response to each unknown as weights of the rows, shape (unknowns, p, (m + 1) n + m).

    The unknowns are B and the first state in the modes' coordinates, with D between them.
    """
    p, n = seen.shape
    one = np.zeros((n, p, n))
    k = 0
    while k < n:
        one[k, :, k] = seen[:, k]
        if modes.imaginary[k] != 0.0:
            # A weight x + i y of a pair multiplies its mode as a complex number.
            one[k, :, k + 1] = seen[:, k + 1]
            one[k + 1, :, k] = seen[:, k + 1]
            one[k + 1, :, k + 1] = -seen[:, k]
            k += 1
        k += 1
    direct = p * m if feedthrough else 0
    columns = np.zeros((m * n + direct + n, p, (m + 1) * n + m))
    for group in range(m):
        part = slice(group * n, (group + 1) * n)
        columns[part, :, part] = one
    columns[m * n + direct :, :, m * n : (m + 1) * n] = one
    for index in range(direct):
        columns[m * n + index, index // m, (m + 1) * n + index % m] = 1.0
    return columns


def _moments(
    modes: _Modes, seen: Array, into: Array, inputs: Array, outputs: Array, input_scale: Array, output_scale: Array
) -> Array | None:
    """Sum of the outer products of the filtered rows of one experiment; none where they overflow."""
    m, n = inputs.shape[1], len(modes.real)
    state, estimate = np.zeros((m + 1, n)), np.zeros(n)
    state[m] = _starts(modes)
    total: Array | None = None
    with np.errstate(all="ignore"):
        for start in range(0, len(outputs), _BLOCK):
            part = slice(start, start + _BLOCK)
            rows = _filtered(
                modes.real, modes.imaginary, seen, into, state, estimate,
                np.ascontiguousarray(inputs[part] / input_scale), np.ascontiguousarray(outputs[part] / output_scale),
            )  # fmt: skip
            products = rows.T @ rows
            total = products if total is None else total + products
    return total if total is not None and np.all(np.isfinite(total)) else None


def _starts(modes: _Modes) -> Array:
    """Free modes at the first sample: each is one."""
    starts, k = np.zeros(len(modes.real)), 0
    while k < len(starts):
        starts[k] = 1.0
        k += 1 if modes.imaginary[k] == 0.0 else 2
    return starts


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
