"""From projections to state-space matrices: the observability matrix, A and C, B and D, and the noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.observer.stationary import riccati
from idloop.estimation.subspace.compression import Compression, check_excitation
from idloop.estimation.subspace.projection import project, regress, row_basis

Weighting = Literal["n4sid", "moesp", "cva"]
# Variance below which noise is rounding, in variances of the outputs: keeps the Riccati equation regular.
_NOISE_FLOOR = 1e-14
_EDGE = 1.0 - 1e-9  # size of a pole that belongs on the unit circle
_INTEGRATOR = 0.1  # largest distance from 1 of a pole that may be an integrator's
_UNSEEN = 0.1  # share by which a pole decays within a window that hardly shows it
_SMALLEST_DEVIATION = 1e-6  # of a combination of future outputs, in deviations of the outputs


@dataclass(frozen=True)
class Future:
    """Rows of the future and their projections on the past, in the columns of the compression.

    M = U + H Y is the command plus what the controller's response to the measurements takes off it. With a known
    controller noise of the future does not reach M, and without feedback M is the command itself (paper of the
    torsion system, eq. 3.6; Van Overschee and De Moor, Automatica 33, 1997).
    """

    horizon: int  # samples i of past and of future
    command: Array  # shape (m i, columns): M over the lags i to 2 i - 1
    command_next: Array  # shape (m (i - 1), columns): M over the lags i + 1 to 2 i - 1
    # Orthogonal projections Z of the future outputs, eq. 3.16 and 3.17
    z: Array  # shape (p i, columns)
    z_next: Array  # shape (p (i - 1), columns)
    oblique: Array  # shape (p i, columns): projection of the future outputs on the past along M, eq. 3.18
    residual: Array  # shape (p i, columns): future outputs with M taken out
    explained: Array  # shape (p i, columns): the part of that which the past explains
    now: Array  # shape (p, columns): outputs at lag i
    command_now: Array  # shape (m, columns): M at lag i

    def correlations(self) -> Array:
        """Canonical correlations between future outputs and past, both with M taken out, largest first."""
        # In orthonormal bases of both row spaces the correlations are plain singular values.
        future, past = row_basis(self.residual, size=float(np.linalg.norm(self.now))), row_basis(self.explained)
        return np.asarray(np.minimum(np.linalg.svd(future @ past.T, compute_uv=False), 1.0))


def toeplitz(markov: list[Array]) -> Array:
    """Lower block triangular Toeplitz matrix of a system's Markov parameters (eq. 3.5)."""
    padded = [*markov, np.zeros_like(markov[0])]
    # Index -1, above the diagonal, is the block of zeros.
    return np.block([[padded[max(down - across, -1)] for across in range(len(markov))] for down in range(len(markov))])


def project_future(compression: Compression, feedback: list[Array] | None = None) -> Future:
    """Split each window in past and future halves and project.

    `compression`: of windows of 2 i samples; `feedback` (m, p): markov parameters D_c, C_c B_c, C_c A_c B_c, ... of the
    controller in u = r - controller(y), one for each lag of the future, in scaled units; none for direct
    identification. Raises InputError: the command excites less than the windows can tell apart.
    """
    i = compression.length // 2
    commands, outputs = compression.u(i, 2 * i), compression.y(i, 2 * i)
    check_excitation(compression)
    m, p = compression.inputs, compression.outputs
    command, command_next = commands, commands[m:]
    if feedback is not None:
        command = commands + toeplitz(feedback[:i]) @ outputs
        command_next = commands[m:] + toeplitz(feedback[: i - 1]) @ outputs[p:]
    past = np.concatenate([compression.u(0, i), compression.y(0, i)])
    longer = np.concatenate([compression.u(0, i + 1), compression.y(0, i + 1)])
    basis = row_basis(command)
    size = float(np.sqrt(np.linalg.eigvalsh(past @ past.T)[-1]))
    residual = outputs - project(outputs, basis)
    past_residual = past - project(past, basis)
    now = outputs[:p]
    return Future(
        horizon=i,
        command=command,
        command_next=command_next,
        z=project(outputs, row_basis(np.concatenate([past, command]))),
        z_next=project(outputs[p:], row_basis(np.concatenate([longer, command_next]))),
        oblique=regress(residual, past_residual, size) @ past,
        residual=residual,
        explained=project(residual, row_basis(past_residual, size)),
        now=now,
        command_now=command[:m],
    )


@dataclass(frozen=True)
class Subspace:
    """The weighted projection's singular value decomposition."""

    left: Array  # shape (p i, r): left singular vectors with the weight on the future undone
    values: Array  # shape (r,): singular values

    def observability(self, order: int) -> Array:
        """Extended observability matrix, shape (p i, order)."""
        return self.left[:, :order] * np.sqrt(self.values[:order])


def weighted_subspace(future: Future, weighting: Weighting) -> Subspace:
    """Decompose the projection with the weights of a method.

    N4SID takes the oblique projection as it is, MOESP its part orthogonal to the future commands, and CVA that part in
    deviations of the future (Van Overschee and De Moor, Automatica 31, 1995, table 1).
    """
    if weighting == "cva":
        own, size, _ = np.linalg.svd(future.residual, full_matrices=False)
        # Without noise the smallest deviations are rounding and must not have full weight.
        size = np.hypot(size, _SMALLEST_DEVIATION * np.linalg.norm(future.now))
        left, values, _ = np.linalg.svd((own.T @ future.explained) / size[:, None], full_matrices=False)
        return Subspace((own * size) @ left, values)
    left, values, _ = np.linalg.svd(future.oblique if weighting == "n4sid" else future.explained, full_matrices=False)
    return Subspace(left, values)


@dataclass(frozen=True)
class Noise:
    """Covariances of the state noise, of the output noise and between the two, in scaled units."""

    process: Array
    output: Array
    cross: Array

    def kalman_gain(self, a: Array, c: Array) -> Array:
        """Stationary gain of the one-step predictor, shape (n, p)."""
        output = self.output + _NOISE_FLOOR * np.eye(len(self.output))
        size = _NOISE_FLOOR * max(float(np.trace(self.process)), 1e-3)
        mixed = np.linalg.solve(output, self.cross.T).T
        process = self.process - mixed @ self.cross.T + size * np.eye(len(a))
        # A decay far slower than any record moves integrators without noise off the unit circle.
        decoupled = (a - mixed @ c) * (1.0 - 1e-7)
        covariance = riccati(decoupled, c, process, output)
        innovation = c @ covariance @ c.T + output
        # In the decoupled form the correlated part comes back as it is.
        return np.asarray(np.linalg.solve(innovation, (decoupled @ covariance @ c.T).T).T + mixed)


@dataclass(frozen=True)
class Transition:
    """States of all windows and what follows them."""

    states: Array  # shape (n, columns)
    after: Array  # shape (n + p, columns): the next states, then the outputs

    def orthogonal_to(self, commands: Array) -> Transition:
        """Without the part of both that the commands' rows explain."""
        basis = row_basis(commands)
        return Transition(self.states - project(self.states, basis), self.after - project(self.after, basis))


def transition(future: Future, observability: Array) -> Transition:
    """States from the projected windows Z, and those from the windows that begin a sample later."""
    p = len(future.now)
    following = _solved(observability[:-p], future.z_next)
    return Transition(_solved(observability, future.z), np.concatenate([following, future.now]))


def shift_invariant(observability: Array, outputs: int) -> tuple[Array, Array]:
    """A and C from the observability matrix alone (MOESP; Verhaegen, Automatica 30, 1994)."""
    return _solved(observability[:-outputs], observability[outputs:]), observability[:outputs].copy()


def regressed(future: Future, transition: Transition) -> tuple[Array, Array]:
    """A and C by regression of state and output on the state before and all future commands.

    The combined algorithm of Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996, figure 4.8.
    """
    coefficients = regress(transition.after, np.concatenate([transition.states, future.command]))
    order = len(transition.states)
    return coefficients[:order, :order], coefficients[order:, :order]


def residual_noise(transition: Transition, a: Array, c: Array) -> Noise:
    """Covariances of the residuals of next state and output, of a transition orthogonal to the commands."""
    return noise(transition.after - np.concatenate([a, c]) @ transition.states, len(a))


def with_known_feedback(
    future: Future, observability: Array, feedthrough: bool, control_now: Array
) -> tuple[Array, Array, Array, Array, Noise]:
    """A, B, C, D and noise by the first algorithm for closed loops, eq. 3.20 to 3.25.

    The thesis prints C = (I + D D_c)^-1 S_21; solving its eq. 3.1 and 3.2 gives C = (I + D D_c) S_21.

    `future`: with the controller's response in M; `observability` (p i, n); `feedthrough`: whether D is estimated; else
    it is zero; `control_now` (m, p): feedthrough D_c of the controller.
    """
    order, p, m = observability.shape[1], len(future.now), len(future.command_now)
    response = _command_response(future, observability, feedthrough)
    whole = toeplitz(response)
    states = _solved(observability, future.z - whole @ future.command)
    shorter = future.z_next - whole[:-p, :-m] @ future.command_next
    following = _solved(observability[:-p], shorter)
    both = np.concatenate([states, future.command_now])
    moves = regress(following, both)
    shows = regress(future.now, both if feedthrough else states)
    s_11, s_12, s_21 = moves[:, :order], moves[:, order:], shows[:, :order]
    s_22 = shows[:, order:] if feedthrough else np.zeros((p, m))
    back = np.linalg.inv(np.eye(m) - control_now @ s_22)
    b, d = s_12 @ back, s_22 @ back
    a, c = s_11 + b @ control_now @ s_21, (np.eye(p) + d @ control_now) @ s_21
    output = (np.eye(p) + d @ control_now) @ (future.now - s_21 @ states - s_22 @ future.command_now)
    state = following - a @ states - b @ (future.command_now - control_now @ future.now)
    return a, b, c, d, noise(np.concatenate([state, output]), order)


def reflected(a: Array) -> Array:
    """A with its poles outside the unit circle reflected into it, the Schur basis kept."""
    from scipy.linalg import schur

    triangle, basis = schur(a, output="real")
    row = 0
    while row < len(a):
        size = 2 if row + 1 < len(a) and triangle[row + 1, row] != 0.0 else 1
        block = slice(row, row + size)
        radius = float(np.max(np.abs(np.linalg.eigvals(triangle[block, block]))))
        if radius >= 1.0:
            # A pole on the circle has no mirror image inside: it is moved just inside.
            triangle[block, block] *= min(1.0 / radius, _EDGE) / radius
        row += size
    return np.asarray(basis @ triangle @ basis.T)


def constrained(a: Array, *, stable: bool, integrates: bool) -> Array:
    """A with what is known of its poles imposed: one integrator, none outside the unit circle."""
    a = integrating(a) if integrates else a
    return reflected(a) if stable else a


def beyond_windows(a: Array, horizon: int) -> bool:
    """Whether a real pole is so slow that a window of the horizon's length hardly shows it decay or grow."""
    poles = np.linalg.eigvals(a)
    real = poles[poles.imag == 0.0].real
    return bool(np.any(np.abs(1.0 - real) * horizon < _UNSEEN))


def integrating(a: Array) -> Array:
    """A with its real pole nearest 1 moved to 1, all eigenvectors kept."""
    from scipy.linalg import eig

    poles, left, right = eig(a, left=True, right=True)
    far = np.where(np.abs(poles.imag) > 0.0, np.inf, np.abs(poles.real - 1.0))
    nearest = int(np.argmin(far))
    if far[nearest] > _INTEGRATOR:
        shown = ", ".join(f"{size:.3g}" for size in np.sort(np.abs(poles))[::-1][:3])
        raise InputError(f"no real pole near 1 (largest sizes {shown}): these data show no integrator; leave it out")
    across, along = left[:, nearest].real, right[:, nearest].real
    # Just within the circle, as a reflected pole: the Riccati equation of the observer needs it off the circle.
    move = _EDGE - poles[nearest].real
    return np.asarray(a + move * np.outer(along, across) / (across @ along))


def kalman_gain(noise: Noise, a: Array, c: Array) -> tuple[Array, tuple[str, ...]]:
    """Gain and notes on it; zero where no stationary predictor exists."""
    try:
        return noise.kalman_gain(a, c), ()
    except (IdloopError, np.linalg.LinAlgError):
        return np.zeros((len(a), len(c))), (
            "no stationary predictor: an unstable mode is not seen at the outputs; the noise model is left out",
        )


def _solved(matrix: Array, target: Array) -> Array:
    return np.asarray(np.linalg.lstsq(matrix, target, rcond=None)[0], dtype=float)


def noise(rest: Array, order: int) -> Noise:
    """Covariances of residuals: the states' rows first, then the outputs'."""
    covariance = rest @ rest.T
    return Noise(covariance[:order, :order], covariance[order:, order:], covariance[:order, order:])


def _command_response(future: Future, observability: Array, feedthrough: bool) -> list[Array]:
    """Markov parameters of the outputs' response to M, from what the states cannot explain (eq. 3.20 and 3.22)."""
    p, m, i = len(future.now), len(future.command_now), future.horizon
    left = np.linalg.svd(observability)[0][:, observability.shape[1] :].T
    # Z minus the states' part lies in the row space of M: its coordinates there are all the equations.
    basis = np.linalg.qr(future.command.T)[0]
    commands, target = future.command @ basis, left @ future.z @ basis
    first = 0 if feedthrough else 1
    columns = []
    for lag in range(first, i):
        # The block K_lag is repeated on one diagonal of the Toeplitz matrix.
        across = left[:, lag * p :].reshape(len(left), i - lag, p)
        along = commands[: (i - lag) * m].reshape(i - lag, m, -1)
        columns.append(np.einsum("ltp,tmc->lcpm", across, along).reshape(-1, p * m))
    solution = regress(target.reshape(1, -1), np.concatenate(columns, axis=1).T)[0]
    blocks = list(solution.reshape(-1, p, m))
    return blocks if feedthrough else [np.zeros((p, m)), *blocks]
