"""Stationary observer with a random-walk disturbance force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError


@dataclass(frozen=True)
class Observer:
    """Stationary Kalman filter of the linear part."""

    gain: Array  # shape (2 b + 1, p): correction of [positions, velocities, disturbance force] per unit innovation
    memory: float  # samples after which an initial error has fallen to one thousandth


def discretise(matrix: Array, noise: Array, sample_time: float) -> tuple[Array, Array]:
    """Transition matrix and noise covariance over one sample (Van Loan, IEEE Trans. Automatic Control 23, 1978).

    `matrix` (m, m): continuous-time system matrix [1/s].
    `noise` (m, m): intensity of the continuous white noise [state²/s].
    `sample_time`: sample time [s].
    Returns `transition`, `covariance` (m, m).
    """
    from scipy.linalg import expm

    m = len(matrix)
    # Fast modes would overflow in exp(−A T): halve the step, and double the result.
    size = float(np.max(np.sum(np.abs(matrix), axis=1))) * sample_time
    halvings = max(int(np.ceil(np.log2(size))), 0) if size > 1.0 else 0
    block = np.zeros((2 * m, 2 * m))
    block[:m, :m] = -matrix
    block[:m, m:] = noise
    block[m:, m:] = matrix.T
    exponential = expm(block * (sample_time / 2.0**halvings))
    transition = exponential[m:, m:].T
    covariance = transition @ exponential[:m, m:]
    for _ in range(halvings):
        covariance = covariance + transition @ covariance @ transition.T
        transition = transition @ transition
    return transition, 0.5 * (covariance + covariance.T)


def riccati(transition: Array, output: Array, process: Array, measurement: Array) -> Array:
    """Stationary prediction covariance by the structure-preserving doubling algorithm.

    Solves ``P = A P Aᵀ − A P Cᵀ (C P Cᵀ + R)⁻¹ C P Aᵀ + Q``. Doubling (Chu, Fan and Lin, Int. J. Control 2005) needs no
    eigenvalue separation, unlike `scipy.linalg.solve_discrete_are`, which fails for an unobserved integrator.

    `transition`, `process` (m, m).
    `output` (p, m).
    `measurement` (p, p).
    Returns shape (m, m).
    Raises IdloopError: if no stationary covariance exists: an unstable motion is not observed.
    """
    m = len(transition)
    identity = np.eye(m)
    a = transition.T
    g = output.T @ np.linalg.solve(measurement, output)
    h = process.copy()
    for _ in range(60):
        try:
            inverse = np.linalg.solve(identity + g @ h, np.hstack([a, g]))
        except np.linalg.LinAlgError:
            break
        step = a.T @ h @ inverse[:, :m]
        g = g + a @ inverse[:, m:] @ a.T
        h_next = h + step
        a = a @ inverse[:, :m]
        h_next = 0.5 * (h_next + h_next.T)
        change = float(np.max(np.abs(h_next - h)))
        h = h_next
        if not np.all(np.isfinite(h)):
            break
        if change <= 1e-13 * float(np.max(np.abs(h))):
            return np.asarray(h)
    raise IdloopError(
        "the observer's Riccati equation has no stationary solution; "
        "the model has an unstable motion that no output measures"
    )


def design(
    a: Array, c: Array, g: Array, sample_time: float, disturbance_intensity: float, output_noise: Array
) -> Observer:
    """Observer gain for one disturbance intensity and output noise.

    `a` (2 b, 2 b), `c` (p, 2 b): continuous linear part; states positions and velocities.
    `g` (2 b,): where the disturbance force enters.
    `disturbance_intensity`: of the random walk that the disturbance force makes [N²/s or (N·m)²/s].
    `output_noise` (p,): standard deviation of the measurement noise [output unit].
    Raises IdloopError: the linear part has an unstable motion that no output measures.
    """
    m, p = len(a), len(c)
    # Outputs in units of their noise: the Riccati equation is well scaled for any machine.
    c_scaled = c / output_noise[:, None]
    force = np.sqrt(disturbance_intensity)
    augmented = np.zeros((m + 1, m + 1))
    augmented[:m, :m] = a
    augmented[:m, m] = np.ravel(g) * force
    noise = np.zeros((m + 1, m + 1))
    noise[m, m] = 1.0
    transition, process = discretise(augmented, noise, sample_time)
    # A decay far slower than any record keeps unobserved integrators bounded.
    transition = transition * (1.0 - 1e-7)
    output = np.hstack([c_scaled, np.zeros((p, 1))])
    prediction = riccati(transition, output, process, np.eye(p))
    innovation = output @ prediction @ output.T + np.eye(p)
    gain = np.linalg.solve(innovation, output @ prediction).T
    closed = transition @ (np.eye(m + 1) - gain @ output)
    memory = _memory(closed, output)
    gain = gain / output_noise[None, :]
    gain[m] *= force
    return Observer(gain, memory)


def _memory(closed: Array, output: Array) -> float:
    """Samples until the outputs' part of an initial error has decayed to 1e-3."""
    values, vectors = np.linalg.eig(closed)
    size = np.abs(values)
    # Unobservable modes, such as an unmeasured angle, do not count.
    seen = np.linalg.norm(output @ vectors, axis=0)
    seen = seen > 1e-6 * max(float(np.max(seen)), 1e-300)
    slowest = float(np.max(size[seen], initial=0.0))
    if slowest >= 1.0:
        return np.inf
    return float(np.log(1e-3) / np.log(max(slowest, 1e-300)))
