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


@njit(cache=True, nogil=True)
def _recursion(
    transition: Any, output: Any, process: Any, covariance: Any, samples: int, gains: Any, innovations: Any
) -> int:
    """Kalman recursion with unit measurement noise; returns the number of steps until the gain settles."""
    m = transition.shape[0]
    p = output.shape[0]
    most = gains.shape[0]
    identity = np.eye(p)
    for k in range(most):
        cross = np.dot(covariance, output.T)
        innovation = np.dot(output, cross) + identity
        gain = np.dot(cross, np.linalg.inv(innovation))
        gains[k] = gain
        innovations[k] = innovation
        # Joseph's form stays positive through a start of many decades.
        left = np.eye(m) - np.dot(gain, output)
        covariance = np.dot(np.dot(left, covariance), left.T) + np.dot(gain, gain.T)
        covariance = np.dot(np.dot(transition, covariance), transition.T) + process
        covariance = 0.5 * (covariance + covariance.T)
        if k > m:
            change = np.max(np.abs(gain - gains[k - 1]))
            if change * (samples - k) <= _SETTLED * np.max(np.abs(gain)):
                return k + 1
    return int(most)
