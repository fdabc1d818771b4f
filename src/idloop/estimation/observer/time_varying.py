"""Kalman filter from an uncertain initial state: observer gains from the first measurement on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.compiled import seldom
from idloop.estimation.observer.small_matrices import (
    assign,
    cholesky,
    multiply,
    multiply_transposed,
    solve_from_right,
    symmetrise,
)

if TYPE_CHECKING:
    from idloop.physics.engine import Linear

Array = NDArray[np.float64]
Places = NDArray[np.int64]

# Relative change of the gain over the rest of the record below which it is constant.
_SETTLED = 1e-3
# After the first of these numbers of measurements, each gain is held for one in the second of those so far.
_SLOWLY, _HELD = 64, 32
# Measurements after which the gain is constant in any case.
_MOST = 20_000


@dataclass(frozen=True)
class TimeVaryingObserver:
    """Kalman filter of the linear part from an uncertain start until its gain settles."""

    gains: Array  # shape (g, 2 b + 1, p): different gains in their order
    covariances: Array  # shape (g, p, p): theoretical innovation covariance with each of them
    # Shape (m,): index of the gain for each of the first m measurements; the last one holds for all that follow
    place: Places

    @property
    def steps(self) -> int:
        """Measurements until the gain is constant."""
        return len(self.place)

    @property
    def gain(self) -> Array:
        """Gains of the first m measurements one below the other, shape (m (2 b + 1), p)."""
        return self.gains[self.place].reshape(-1, self.gains.shape[2])

    @property
    def covariance(self) -> Array:
        """Innovation covariance at each of the first m measurements, shape (m, p, p)."""
        return self.covariances[self.place]


def time_varying_observer(
    linear: Linear,
    measured: list[int],
    sample_time: float,
    disturbance_intensity: float,
    output_noise: Array,
    start: Array,
    samples: int,
    decay: float = 1.0,
) -> TimeVaryingObserver:
    """Time-varying observer with a disturbance force (Anderson and Moore, Optimal Filtering, 1979, ch. 3).

    The force is held from sample to sample, and decays.

    `linear`: 2 b states and p outputs, of which those `measured` have measurements.
    `disturbance_intensity`: variance that the disturbance force gains in every sample, per second [force²/s].
    `output_noise` (p,): standard deviation of the measurement noise.
    `start` (2 b + 1,): standard deviation of the initial positions, velocities and disturbance force.
    `samples`: length of the record.
    `decay`: factor of the force from sample to sample: 1 for a random walk, 0 for white noise.
    """
    # Imported on first use, for a quick start of the command line.
    from scipy.linalg import expm, null_space

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
    prior = np.diag(np.square(start))
    prior[m, m] /= force**2
    bodies = m // 2
    if not np.any(linear.C[measured][:, :bodies]):
        # Where the axis stands makes no difference, and as an unknown it would cost the other states their digits.
        free = null_space(linear.A[:, :bodies])
        seen = np.eye(bodies) - free @ free.T
        prior[:bodies, :bodies] = seen @ prior[:bodies, :bodies] @ seen
    most = max(min(samples, _MOST), 1)
    room = min(most, _room(most))
    gains = np.empty((room, m + 1, len(measured)))
    covariances = np.empty((room, len(measured), len(measured)))
    place = np.empty(most, dtype=np.int64)
    count = _recursion(
        np.ascontiguousarray(transition), np.ascontiguousarray(output), process, prior, samples, gains,
        covariances, place,
    )  # fmt: skip
    different = int(place[count - 1]) + 1
    full = np.zeros((different, m + 1, p))
    full[:, :, measured] = gains[:different] / noise
    full[:, m] *= force
    expected = np.zeros((different, p, p))
    expected[np.ix_(range(different), measured, measured)] = covariances[:different] * np.outer(noise, noise)
    return TimeVaryingObserver(full, expected, place[:count])


def _room(most: int) -> int:
    """Largest number of different gains: one for each of the first measurements, then 2 `_HELD` for each doubling."""
    return _SLOWLY + (2 * _HELD + 2) * (int(np.log2(most)) + 2)


@njit(cache=True, nogil=True, error_model="numpy")
def scalings_to_last(covariance: Any) -> Any:
    """Matrices (g, p, p) that scale vectors of covariances (g, p, p), positive, to the last of these covariances."""
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
    """Multiply each of the first rows of a series (n, p) by ``scalings[place]`` (g, p, p), in place."""
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


@seldom
def _updated(covariance: Any, information: Any) -> Any:
    """Covariance (P^-1 + M)^-1 beside further information, as L (I + L' M L)^-1 L' with P = L L'.

    Accurate also where P is large in a direction in which M is none but for rounding, as the position of an axis of
    which the velocity alone is measured.
    """
    size = covariance.shape[0]
    values, root = np.linalg.eigh(covariance)
    for j in range(size):
        scale = np.sqrt(max(values[j], 0.0))
        for i in range(size):
            root[i, j] *= scale
    back = np.ascontiguousarray(root.T)
    within = back @ information @ root
    for i in range(size):
        within[i, i] += 1.0
    ahead = root.copy()
    solve_from_right(within, np.empty((size, size)), ahead)
    return ahead @ back


@seldom
def _doubled_steps(transition: Any, output: Any, process: Any, count: int) -> Any:
    """Riccati steps of 2^j samples as (A, Q, M) of P -> Q + A P (I + M P)^-1 A', shape (count, 3, m, m).

    Doubling by Anderson, Int. J. Control 28, 1978.
    """
    m = transition.shape[0]
    found = np.empty((count, 3, m, m))
    assign(transition, found[0, 0])
    assign(process, found[0, 1])
    assign(np.ascontiguousarray(output.T) @ output, found[0, 2])
    for j in range(1, count):
        a, q, h = found[j - 1, 0], found[j - 1, 1], found[j - 1, 2]
        back = np.ascontiguousarray(a.T)
        updated = _updated(q, h)
        ahead = a - updated @ (h @ a)
        assign(a @ ahead, found[j, 0])
        assign(q + a @ (updated @ back), found[j, 1])
        assign(h + back @ (h @ ahead), found[j, 2])
        symmetrise(found[j, 1])
        symmetrise(found[j, 2])
    return found


@njit(cache=True, nogil=True, error_model="numpy")  # a singular matrix gives gains that are NaN
def _recursion(
    transition: Any, output: Any, process: Any, covariance: Any, samples: int, gains: Any, innovations: Any, place: Any
) -> int:
    """Kalman recursion with unit measurement noise; returns the number of steps until the gain is constant.

    Fills ``gains``, ``innovations`` (their covariances) and ``place``. Later gains change slowly: they are held for
    several steps, which are then taken at once.
    """
    m = transition.shape[0]
    p = output.shape[0]
    most = place.shape[0]
    factor = np.zeros((p, p))
    left, half, whole = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    steps_by_power = np.empty((0, 3, m, m))
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
            if steps_by_power.shape[0] == 0:
                steps_by_power = _doubled_steps(transition, output, process, int(np.log2(most)) + 1)
            a, q, h = steps_by_power[level, 0], steps_by_power[level, 1], steps_by_power[level, 2]
            whole = q + a @ _updated(covariance, h) @ np.ascontiguousarray(a.T)
            for i in range(m):
                for j in range(m):
                    covariance[i, j] = 0.5 * (whole[i, j] + whole[j, i])
        else:
            # Joseph's form stays positive for an initial covariance of many decades.
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
