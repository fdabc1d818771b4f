"""Observer gains from the first measurement on, while the observer still learns the initial state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.physics.engine import Linear

Array = NDArray[np.float64]

# Gains that change less than this over the rest of the record are taken as settled.
_SETTLED = 1e-3
# Measurements after which the gain is held in any case.
_MOST = 20_000


@dataclass(frozen=True)
class SettlingObserver:
    """Kalman filter of the linear part from an uncertain start until its gain settles.

    Attributes
    ----------
    gain : array, shape (m (2 b + 1), p)
        Gains one below the other, for the first m measurements; the last holds from there on.
    covariance : array, shape (m, p, p)
        Innovation covariance that the linear theory expects at each of them.
    """

    gain: Array
    covariance: Array

    @property
    def steps(self) -> int:
        """Measurements until the gain has settled."""
        return len(self.covariance)


def settling_observer(
    linear: Linear,
    measured: list[int],
    sample_time: float,
    disturbance_intensity: float,
    output_noise: Array,
    start: Array,
    samples: int,
    decay: float = 1.0,
) -> SettlingObserver:
    """Time-varying observer with a disturbance force (Anderson and Moore, Optimal Filtering, 1979, ch. 3).

    The force is held from sample to sample and forgotten by and by.

    Parameters
    ----------
    linear : Linear
        Linear part, 2 b states and p outputs.
    measured : list of int
        Outputs that carry measurements.
    sample_time : float
        Sample time [s].
    disturbance_intensity : float
        Variance that the disturbance force gains in every sample, per second [force²/s].
    output_noise : array, shape (p,)
        Standard deviation of the measurement noise.
    start : array, shape (2 b + 1,)
        Standard deviation of the initial positions, velocities and disturbance force.
    samples : int
        Length of the record.
    decay : float
        Part of the disturbance force that one sample leaves for the next: 1 makes it a random walk, 0 white.

    Returns
    -------
    SettlingObserver
    """
    # Loaded on first use: verbs that fit nothing do without.
    from scipy.linalg import expm

    m, p = len(linear.A), len(linear.C)
    noise = output_noise[measured]
    force = max(float(np.sqrt(disturbance_intensity)), 1e-300)
    augmented = np.zeros((m + 1, m + 1))
    augmented[:m, :m] = linear.A
    augmented[:m, m] = linear.G * force
    process = np.zeros((m + 1, m + 1))
    transition = expm(augmented * sample_time)
    transition[m, m], process[m, m] = decay, sample_time
    output = np.hstack([linear.C[measured] / noise[:, None], np.zeros((len(measured), 1))])
    prior = np.square(start)
    prior[m] /= force**2
    most = max(min(samples, _MOST), 1)
    gains = np.empty((most, m + 1, len(measured)))
    covariances = np.empty((most, len(measured), len(measured)))
    count = _recursion(
        np.ascontiguousarray(transition), np.ascontiguousarray(output), process, np.diag(prior), samples, gains,
        covariances,
    )  # fmt: skip
    gains, covariances = gains[:count], covariances[:count]
    full = np.zeros((count, m + 1, p))
    full[:, :, measured] = gains / noise
    full[:, m] *= force
    expected = np.zeros((count, p, p))
    expected[np.ix_(range(count), measured, measured)] = covariances * np.outer(noise, noise)
    return SettlingObserver(full.reshape(count * (m + 1), p), expected)


# Matrices of a few rows are multiplied faster here than by a library that is called for each.
@njit(cache=True, nogil=True, inline="always")
def _multiply(a: Any, b: Any, out: Any) -> None:
    """Matrix product A B into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for n in range(a.shape[1]):
                total += a[i, n] * b[n, j]
            out[i, j] = total


@njit(cache=True, nogil=True, inline="always")
def _multiply_transposed(a: Any, b: Any, out: Any) -> None:
    """Matrix product A B' into `out`."""
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            total = 0.0
            for n in range(a.shape[1]):
                total += a[i, n] * b[j, n]
            out[i, j] = total


@njit(cache=True, nogil=True, inline="always")
def _solve_from_right(a: Any, factor: Any, b: Any) -> None:
    """Replace the rows of `b` by B A^-1, A symmetric and positive; `factor` takes its Cholesky factor."""
    p = a.shape[0]
    for i in range(p):
        for j in range(i + 1):
            total = a[i, j]
            for n in range(j):
                total -= factor[i, n] * factor[j, n]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
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


@njit(cache=True, nogil=True)
def _recursion(
    transition: Any, output: Any, process: Any, covariance: Any, samples: int, gains: Any, innovations: Any
) -> int:
    """Kalman recursion with unit measurement noise; returns the number of steps until the gain settles."""
    m = transition.shape[0]
    p = output.shape[0]
    most = gains.shape[0]
    factor = np.zeros((p, p))
    left, half, whole = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    for k in range(most):
        gain, innovation = gains[k], innovations[k]
        _multiply_transposed(covariance, output, gain)
        _multiply(output, gain, innovation)
        for i in range(p):
            innovation[i, i] += 1.0
        _solve_from_right(innovation, factor, gain)
        # Joseph's form stays positive through a start of many decades.
        _multiply(gain, output, left)
        for i in range(m):
            for j in range(m):
                left[i, j] = (1.0 if i == j else 0.0) - left[i, j]
        _multiply(left, covariance, half)
        _multiply_transposed(half, left, whole)
        for i in range(m):
            for j in range(m):
                for n in range(p):
                    whole[i, j] += gain[i, n] * gain[j, n]
        _multiply(transition, whole, half)
        _multiply_transposed(half, transition, whole)
        change = largest = 0.0
        for i in range(m):
            for j in range(m):
                covariance[i, j] = 0.5 * (whole[i, j] + whole[j, i]) + process[i, j]
            for j in range(p):
                largest = max(largest, abs(gain[i, j]))
                if k > 0:
                    change = max(change, abs(gain[i, j] - gains[k - 1, i, j]))
        if k > m and change * (samples - k) <= _SETTLED * largest:
            return k + 1
    return int(most)
