"""What nobody measures: disturbance torque and measurement noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POLE = 0.9


def autoregressive(white: Array, pole: float = POLE) -> Array:
    """First-order autoregression of unit variance, started in its stationary distribution."""
    from scipy.signal import lfilter

    gain = np.sqrt(1.0 - pole**2)
    driven = white * gain
    driven[0] = white[0]
    return np.asarray(lfilter([1.0], [1.0, -pole], driven, axis=0))


def disturbance(kind: str, rms: float, samples: int, seed: int) -> Array:
    """Torque on the first body, held over each sample (n,).

    Parameters
    ----------
    kind : str
        ``none``, ``white``, ``walk`` or ``ar``.
    rms : float
        Root mean square over the record; of a random walk the expected one.
    samples : int
    seed : int
    """
    white = np.random.default_rng(seed).standard_normal(samples)
    if kind == "none" or rms == 0.0:
        return np.zeros(samples)
    if kind == "white":
        return rms * white
    if kind == "ar":
        return rms * autoregressive(white)
    return np.asarray(rms * np.sqrt(2.0 / samples) * np.cumsum(white))


def measurement_noise(kind: str, std: Array, samples: int, seed: int) -> Array:
    """Noise of every sensor (n, p)."""
    white = np.random.default_rng(seed).standard_normal((samples, len(std)))
    return np.asarray((autoregressive(white) if kind == "ar" else white) * std)
