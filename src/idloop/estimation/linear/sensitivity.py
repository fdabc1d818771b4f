"""One-step errors of an innovation model and their exact derivatives, compressed as they are made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.linear.least_squares import solve

Array = NDArray[np.float64]

_BLOCK_NUMBERS = 2_000_000  # numbers of one block of derivatives: fits the cache and the memory of a small machine
_OVERFLOW = 1e100  # beyond it squares overflow
_MOST_SCORES = 50_000  # rows: longer records are summed in stretches first


@dataclass(frozen=True)
class Matrices:
    """A model x(k+1) = A x + B u + K e, y = C x + D u + e, or a direction in the space of such models."""

    # Shapes (n, n), (n, m), (p, n), (p, m), (n, p); a stack of k directions has a last axis of length k
    a: Array
    b: Array
    c: Array
    d: Array
    gain: Array

    @property
    def parts(self) -> tuple[Array, Array, Array, Array, Array]:
        """A, B, C, D and K."""
        return self.a, self.b, self.c, self.d, self.gain

    def flat(self) -> Array:
        """All entries in one row; a stack gives one column for each direction."""
        stacked = self.a.shape[2:]
        return np.concatenate([part.reshape(-1, *stacked) for part in self.parts])

    def like(self, flat: Array) -> Matrices:
        """Matrices of these shapes from entries in the order of `flat`; columns give a stack."""
        parts, at = [], 0
        for part in self.parts:
            shape = part.shape[:2]
            size = shape[0] * shape[1]
            parts.append(np.ascontiguousarray(flat[at : at + size].reshape(*shape, *flat.shape[1:])))
            at += size
        return Matrices(*parts)


@njit(cache=True, fastmath={"contract", "reassoc"})
def _run(
    a: Array, b: Array, c: Array, d: Array, gain: Array, state: Array, inputs: Array, outputs: Array
) -> tuple[Array, Array]:
    """States before each sample (N, n) and errors (N, p); `state` goes on in place."""
    samples, n, m, p = outputs.shape[0], a.shape[0], b.shape[1], c.shape[0]
    states, errors = np.empty((samples, n)), np.empty((samples, p))
    for t in range(samples):
        for i in range(n):
            states[t, i] = state[i]
        for q in range(p):
            errors[t, q] = outputs[t, q]
            for j in range(n):
                errors[t, q] -= c[q, j] * state[j]
            for j in range(m):
                errors[t, q] -= d[q, j] * inputs[t, j]
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += a[i, j] * states[t, j]
            for j in range(m):
                total += b[i, j] * inputs[t, j]
            for q in range(p):
                total += gain[i, q] * errors[t, q]
            state[i] = total
    return states, errors


@njit(cache=True, fastmath={"contract", "reassoc"})
def _accumulate(closed: Array, moved: Array, drive: Array) -> None:
    """Replace a drive (N, n, k) by what x(t+1) = `closed` x(t) + drive(t) was before it; `moved` (n, k) goes on."""
    samples, n, k = drive.shape
    following = np.empty((n, k))
    for t in range(samples):
        for i in range(n):
            for s in range(k):
                following[i, s] = drive[t, i, s]
            for j in range(n):
                for s in range(k):
                    following[i, s] += closed[i, j] * moved[j, s]
        for i in range(n):
            for s in range(k):
                drive[t, i, s] = moved[i, s]
                moved[i, s] = following[i, s]


def compressed_errors(
    model: Matrices,
    directions: Matrices | None,
    experiments: Sequence[tuple[Array, Array]],
    whitener: Array,
    initial: bool = True,
) -> tuple[Array, Array]:
    """Errors and Jacobian of all experiments as triangular factors, the first states left out.

    The errors are linear in the first state, so its best value is eliminated in each experiment by an orthogonal
    transformation (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's Jacobian).
    What is returned has the sums of squares and products of the full arrays, in as many rows as columns. Cost is
    linear in the length of the record and memory does not depend on it.

    `directions`: stack of k directions in which the derivatives are wanted; `experiments`: shapes (N, m) and (N, p);
    `whitener` (p, p): applied to each error; `initial`: whether the first state of each experiment is estimated; else
    it is zero. Returns `residual` (r,); `jacobian` (r, k): infinite where the model's predictor overflows.
    """
    moves = directions if directions is not None else _no_directions(model)
    first, k = (model.a.shape[0] if initial else 0), moves.a.shape[2]
    whole = np.zeros((0, k + 1))
    for inputs, outputs in experiments:
        # The derivatives are those along the trajectory from the best first state, so that comes first.
        state = _first_state(model, inputs, outputs, whitener) if initial and k else np.zeros(len(model.a))
        factor = _factor(model, moves, inputs, outputs, whitener, first, state)
        if not np.all(np.isfinite(factor)):
            whole = np.full((k + 1, k + 1), np.inf)
            break
        whole = np.asarray(np.linalg.qr(np.vstack([whole, factor[first:, first:]]), mode="r"))
    return whole[:, -1], whole[:, :-1]


def error_moments(model: Matrices, experiments: Sequence[tuple[Array, Array]], initial: bool) -> Array:
    """Mean product of the errors over all experiments, shape (p, p); infinite where they overflow."""
    p = model.c.shape[0]
    still, unit = _no_directions(model), np.eye(p)
    total, count = np.zeros((p, p)), 0
    for inputs, outputs in experiments:
        for rows in _at_best_state(model, still, inputs, outputs, unit, initial):
            errors = rows[:, :, -1]
            total += errors.T @ errors
            count += len(errors)
    moments = total / max(count, 1)
    return moments if np.all(np.isfinite(moments)) else np.full((p, p), np.inf)


def score_sums(
    model: Matrices, directions: Matrices, experiments: Sequence[tuple[Array, Array]], whitener: Array, initial: bool
) -> list[Array]:
    """Derivatives times errors, summed over stretches of samples, of each experiment, shape (stretches, k).

    Their long-run covariance is that of the gradient, whatever the errors' colour.
    """
    k = directions.a.shape[2]
    stretch = max(sum(len(outputs) for _, outputs in experiments) // _MOST_SCORES, 1)
    found = []
    for inputs, outputs in experiments:
        sums = [
            np.add.reduceat(np.einsum("tqs,tq->ts", rows[:, :, :k], rows[:, :, k]), np.arange(0, len(rows), stretch))
            for rows in _at_best_state(model, directions, inputs, outputs, whitener, initial)
        ]
        found.append(np.concatenate(sums))
    return found


def _first_state(model: Matrices, inputs: Array, outputs: Array, whitener: Array) -> Array:
    """First state of smallest errors; zero where they overflow."""
    order = len(model.a)
    factor = _factor(model, _no_directions(model), inputs, outputs, whitener, order, np.zeros(order))
    if not np.all(np.isfinite(factor)):
        return np.zeros(order)
    return -solve(factor[:order, :order], factor[:order, order], 1e-12)


def _no_directions(model: Matrices) -> Matrices:
    """No direction at all."""
    return model.like(np.zeros((model.flat().size, 0)))


def _factor(
    model: Matrices, moves: Matrices, inputs: Array, outputs: Array, whitener: Array, first: int, start: Array
) -> Array:
    """Triangular factor of the columns (first state, directions, error) of one experiment."""
    wide = first + moves.a.shape[2] + 1
    factor = np.zeros((0, wide))
    for rows in _blocks(model, moves, inputs, outputs, whitener, first, start):
        flat = rows.reshape(-1, wide)
        if not np.all(np.abs(flat) < _OVERFLOW):
            return np.full((wide, wide), np.inf)
        factor = np.asarray(np.linalg.qr(np.vstack([factor, flat]), mode="r"))
    if len(factor) < wide:
        factor = np.vstack([factor, np.zeros((wide - len(factor), wide))])
    return np.asarray(factor)


def _at_best_state(
    model: Matrices, moves: Matrices, inputs: Array, outputs: Array, whitener: Array, initial: bool
) -> Iterator[Array]:
    """Blocks of the columns (directions, error) with the part of the first state taken out."""
    first = model.a.shape[0] if initial else 0
    start = _first_state(model, inputs, outputs, whitener) if initial else np.zeros(len(model.a))
    factor = _factor(model, moves, inputs, outputs, whitener, first, start)
    if not np.all(np.isfinite(factor)):
        yield np.full((1, outputs.shape[1], factor.shape[1] - first), np.inf)
        return
    part = solve(factor[:first, :first], factor[:first, first:], 1e-12)
    for rows in _blocks(model, moves, inputs, outputs, whitener, first, start):
        yield rows[:, :, first:] - rows[:, :, :first] @ part


def _blocks(
    model: Matrices, moves: Matrices, inputs: Array, outputs: Array, whitener: Array, first: int, start_state: Array
) -> Iterator[Array]:
    """Blocks of the columns (first state, directions, error), shape (samples, p, columns)."""
    order, k = model.a.shape[0], moves.a.shape[2]
    state, moved = start_state.copy(), np.zeros((order, first + k))
    # The first states come first, so that the rows below them are what no first state explains.
    moved[:, :first] = np.eye(order)[:, :first]
    closed = model.a - model.gain @ model.c
    length = max(_BLOCK_NUMBERS // (outputs.shape[1] * (k + first + 1)), 256)
    fixed = [np.ascontiguousarray(part) for part in model.parts]
    # Directions as changes of the next state by (state, command, error), and of the output by (state, command).
    into_state = np.concatenate([moves.a, moves.b, moves.gain], axis=1).swapaxes(0, 1)
    into_output = np.concatenate([moves.c, moves.d], axis=1).swapaxes(0, 1)
    for start in range(0, outputs.shape[0], length):
        part = slice(start, start + length)
        states, errors = _run(*fixed, state, np.ascontiguousarray(inputs[part]), np.ascontiguousarray(outputs[part]))
        with np.errstate(all="ignore"):
            signals = np.hstack([states, inputs[part], errors])
            shown = np.tensordot(signals[:, : len(into_output)], into_output, axes=1)
            drive = np.zeros((len(errors), order, first + k))
            drive[:, :, first:] = np.tensordot(signals, into_state, axes=1) - model.gain @ shown
            _accumulate(closed, moved, drive)
            derivatives = -(model.c @ drive)
            derivatives[:, :, first:] -= shown
            yield np.asarray(whitener @ np.concatenate([derivatives, errors[:, :, None]], axis=2))
