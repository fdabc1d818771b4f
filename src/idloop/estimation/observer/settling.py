"""Observer gains from the first measurement on, while the observer still learns the initial state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.observer.small_matrices import cholesky, multiply, multiply_transposed, solve_from_right

if TYPE_CHECKING:
    from idloop.physics.engine import Linear

Array = NDArray[np.float64]
Places = NDArray[np.int64]

# Gains that change less than this over the rest of the record are taken as settled.
_SETTLED = 1e-3
# From so many measurements on the gain is held for this part of those so far.
_SLOWLY, _HELD = 64, 32
# Measurements after which the gain is held in any case.
_MOST = 20_000


@dataclass(frozen=True)
class SettlingObserver:
    """Kalman filter of the linear part from an uncertain start until its gain settles.

    Attributes
    ----------
    gains : array, shape (g, 2 b + 1, p)
        Gains in the order in which they serve.
    covariances : array, shape (g, p, p)
        Innovation covariance that the linear theory expects with each of them.
    place : array of int, shape (m,)
        Which of them serve the first m measurements; the last of these holds from there on.
    """

    gains: Array
    covariances: Array
    place: Places

    @property
    def steps(self) -> int:
        """Measurements until the gain has settled."""
        return len(self.place)

    @property
    def gain(self) -> Array:
        """Gains of the first m measurements one below the other, shape (m (2 b + 1), p)."""
        return self.gains[self.place].reshape(-1, self.gains.shape[2])

    @property
    def covariance(self) -> Array:
        """Innovation covariance at each of the first m measurements, shape (m, p, p)."""
        return self.covariances[self.place]


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
    room = min(most, _room(most))
    gains = np.empty((room, m + 1, len(measured)))
    covariances = np.empty((room, len(measured), len(measured)))
    place = np.empty(most, dtype=np.int64)
    count = _recursion(
        np.ascontiguousarray(transition), np.ascontiguousarray(output), process, np.diag(prior), samples, gains,
        covariances, place,
    )  # fmt: skip
    different = int(place[count - 1]) + 1
    full = np.zeros((different, m + 1, p))
    full[:, :, measured] = gains[:different] / noise
    full[:, m] *= force
    expected = np.zeros((different, p, p))
    expected[np.ix_(range(different), measured, measured)] = covariances[:different] * np.outer(noise, noise)
    return SettlingObserver(full, expected, place[:count])


def _room(most: int) -> int:
    """Bound on the number of different gains: all of the first ones, then twice `_HELD` for each doubling."""
    return _SLOWLY + (2 * _HELD + 2) * (int(np.log2(most)) + 2)


@njit(cache=True, nogil=True, error_model="numpy")
def scalings_to_last(covariance: Any) -> Any:
    """Matrices that bring vectors of given covariances to the last one of these.

    Parameters
    ----------
    covariance : array, shape (g, p, p)
        Positive matrices.

    Returns
    -------
    array, shape (g, p, p)
    """
    m, p = covariance.shape[:2]
    last, factor = np.zeros((p, p)), np.zeros((p, p))
    cholesky(covariance[m - 1], last)
    found = np.empty((m, p, p))
    for k in range(m):
        cholesky(covariance[k], factor)
        # X L = L_last, row by row from the right.
        for row in range(p):
            for back in range(p):
                i = p - 1 - back
                total = last[row, i]
                for n in range(i + 1, p):
                    total -= found[k, row, n] * factor[n, i]
                found[k, row, i] = total / factor[i, i]
    return found


@njit(cache=True, nogil=True)
def scale_start(series: Any, scalings: Any, place: Any) -> None:
    """Multiply the first rows of a series, each by its matrix, in place.

    Parameters
    ----------
    series : array, shape (n, p)
    scalings : array, shape (g, p, p)
    place : array of int, shape (m,)
        Which matrix each of the first m rows takes; n may be less.
    """
    p = series.shape[1]
    row = np.empty(p)
    for k in range(min(series.shape[0], place.shape[0])):
        matrix = scalings[place[k]]
        for i in range(p):
            row[i] = series[k, i]
        for i in range(p):
            total = 0.0
            for j in range(p):
                total += matrix[i, j] * row[j]
            series[k, i] = total


@njit(cache=True, nogil=True)
def _leaps(transition: Any, output: Any, process: Any, count: int) -> Any:
    """What 2^j steps make of a covariance P, as (A, Q, M) of Q + A P (I + M P)^-1 A', shape (count, 3, m, m).

    Doubling: Anderson, "Second-order convergent algorithms for the steady-state Riccati equation",
    Int. J. Control 28, 1978.
    """
    m = transition.shape[0]
    found = np.empty((count, 3, m, m))
    found[0, 0], found[0, 1], found[0, 2] = transition, process, np.ascontiguousarray(output.T) @ output
    for j in range(1, count):
        a, q, h = found[j - 1, 0], found[j - 1, 1], found[j - 1, 2]
        back = np.ascontiguousarray(a.T)
        inverse = np.linalg.inv(np.eye(m) + q @ h)
        ahead = inverse @ a
        found[j, 0] = a @ ahead
        found[j, 1] = q + a @ (inverse @ (q @ back))
        found[j, 2] = h + back @ (h @ ahead)
        for part in range(1, 3):
            found[j, part] = 0.5 * (found[j, part] + found[j, part].T)
    return found


@njit(cache=True, nogil=True, error_model="numpy")  # a matrix that has lost its rank makes gains that are no numbers
def _recursion(
    transition: Any, output: Any, process: Any, covariance: Any, samples: int, gains: Any, innovations: Any, place: Any
) -> int:
    """Kalman recursion with unit measurement noise; returns the number of steps until the gain settles.

    Different gains go to ``gains``, and which of them serves each measurement to ``place``.

    Later on the gain changes slowly: from there it is computed every so often, and held in between.
    """
    m = transition.shape[0]
    p = output.shape[0]
    most = place.shape[0]
    factor = np.zeros((p, p))
    left, half, whole = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    leaps = np.empty((0, 3, m, m))
    k, held, different = 0, 1, 0
    while k < most:
        gain, innovation = gains[different], innovations[different]
        multiply_transposed(covariance, output, gain)
        multiply(output, gain, innovation)
        for i in range(p):
            innovation[i, i] += 1.0
        solve_from_right(innovation, factor, gain)
        change = largest = 0.0
        for i in range(m):
            for j in range(p):
                largest = max(largest, abs(gain[i, j]))
                if k > 0:
                    change = max(change, abs(gain[i, j] - gains[different - 1, i, j]))
        place[k] = different
        if k > m and change / held * (samples - k) <= _SETTLED * largest:
            return k + 1
        level = 0
        while k >= _SLOWLY and 2 ** (level + 1) <= min(k // _HELD, most - k):
            level += 1
        held = 2**level
        for later in range(1, held):
            place[k + later] = different
        if held > 1:
            if leaps.shape[0] == 0:
                leaps = _leaps(transition, output, process, int(np.log2(most)) + 1)
            a, q, h = leaps[level, 0], leaps[level, 1], leaps[level, 2]
            inverse = np.linalg.inv(np.eye(m) + h @ covariance)
            whole[:] = q + a @ (covariance @ inverse) @ np.ascontiguousarray(a.T)
            for i in range(m):
                for j in range(m):
                    covariance[i, j] = 0.5 * (whole[i, j] + whole[j, i])
        else:
            # Joseph's form stays positive through a start of many decades.
            multiply(gain, output, left)
            for i in range(m):
                for j in range(m):
                    left[i, j] = (1.0 if i == j else 0.0) - left[i, j]
            multiply(left, covariance, half)
            multiply_transposed(half, left, whole)
            for i in range(m):
                for j in range(m):
                    for n in range(p):
                        whole[i, j] += gain[i, n] * gain[j, n]
            multiply(transition, whole, half)
            multiply_transposed(half, transition, whole)
            for i in range(m):
                for j in range(m):
                    covariance[i, j] = 0.5 * (whole[i, j] + whole[j, i]) + process[i, j]
        k += held
        different += 1
    return int(most)
