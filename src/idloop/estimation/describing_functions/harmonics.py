"""Harmonics of an answer to a sine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def period_harmonics(value: Floats, phase: Floats, count: int) -> Complexes:
    """Harmonics of one period that is sampled evenly.

    `value` (n,): samples of a whole number of periods; `phase` (n,): phase of each [rad]; `count`: highest harmonic.
    Returns shape (count + 1,): mean, then Y_k of value = mean + Σ Im(Y_k exp(j k phase)): A of A·sin(phase) is real.
    """
    order = np.arange(count + 1)
    phasors: Complexes = 2j / value.size * (np.exp(-1j * np.outer(order, phase)) @ value)
    phasors[0] = value.mean()
    return phasors


def distortion(value: Floats, fundamental: complex) -> float:
    """Total harmonic distortion of whole periods: rms of all harmonics above the first over that of the first.

    Returns: 0 for a sine, 0.483 for a square wave, infinite without a fundamental; NaN for a constant.
    """
    power, first = 2.0 * float(np.var(value)), abs(fundamental) ** 2
    # what rounding leaves of a constant is no oscillation
    floor = 1e-24 * float(np.max(value**2, initial=0.0))
    if power <= floor:
        return float("nan")
    return float(np.sqrt(max(power - first, 0.0) / first)) if first > floor else float("inf")
