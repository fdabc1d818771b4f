"""A sine of known frequency and its harmonics in a signal, sampled or held."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Complex


@dataclass(frozen=True, eq=False)
class SineFit:
    """Harmonics of one signal over whole periods."""

    phasors: Complex  # shape (m,): of harmonics 1..m: the signal is Σ Im(Y_k exp(2πj k f t)) and its mean and trend
    mean: float  # signal's mean, the harmonics apart
    beside: Complex  # shape (q,): what is left at the frequencies beside the fundamental that were asked for

    @property
    def distortion(self) -> float:
        """Rms of the fitted harmonics above the first over that of the first; NaN without a first one."""
        first = abs(self.phasors[0])
        return float(np.sqrt(np.sum(np.abs(self.phasors[1:]) ** 2))) / first if first > 0.0 else float("nan")


def sine_fit(
    time: Array, value: Array, frequency: float, harmonics: int, *, trend: bool = True, beside: Array | None = None
) -> SineFit:
    """Fit mean, straight line, sine and harmonics to samples (n,) of whole periods by least squares.

    `trend`: let the signal drift along a straight line, as a position does; `beside` (q,): frequencies [Hz] at which
    the residual is wanted.
    """
    phase = 2.0 * math.pi * frequency * np.outer(time, np.arange(1, harmonics + 1))
    middle, span = 0.5 * (time[0] + time[-1]), max(float(time[-1] - time[0]), 1e-300)
    columns = [np.ones((time.size, 1)), np.sin(phase), np.cos(phase)]
    if trend:
        columns.append(((time - middle) / span)[:, None])
    regressors = np.concatenate(columns, axis=1)
    found = np.linalg.lstsq(regressors, value, rcond=None)[0]
    phasors = found[1 : harmonics + 1] + 1j * found[harmonics + 1 : 2 * harmonics + 1]
    residual = value - regressors @ found
    other = np.zeros(0) if beside is None else beside
    left = 2j / time.size * (np.exp(-2j * math.pi * np.outer(other, time)) @ residual)
    return SineFit(phasors, float(found[0]), left)


def held_sine_fit(
    time: Array,
    value: Array,
    start: float,
    stop: float,
    frequency: float,
    harmonics: int,
    *,
    beside: Array | None = None,
) -> SineFit:
    """Harmonics from `start` to `stop` of a signal that is held from each stamp to the next, by exact integration.

    A held sine lags its samples by half a sample and is a little smaller: the axis sees the held one.
    """
    first = max(int(np.searchsorted(time, start, side="right")) - 1, 0)
    after = int(np.searchsorted(time, stop, side="left"))
    edges = np.concatenate([[start], time[first + 1 : after], [stop]])
    held = value[first : max(after, first + 1)]
    every = np.concatenate([frequency * np.arange(1, harmonics + 1), np.zeros(0) if beside is None else beside])
    omega = 2.0 * math.pi * every
    turned = np.exp(-1j * np.outer(omega, edges))
    # 2j/T ∫ u exp(−jωt) dt over each hold
    parts = 2j / (stop - start) * (np.diff(turned, axis=1) @ held) / (-1j * omega)
    mean = float(np.diff(edges) @ held / (stop - start))
    return SineFit(parts[:harmonics], mean, parts[harmonics:])


def refine_frequency(time: Array, value: Array, frequency: float) -> float:
    """Frequency [Hz] at which a sine leaves the least of a signal; the guess is right to half a period over it."""
    from scipy.optimize import minimize_scalar

    reach = 0.5 / float(time[-1] - time[0])
    around = time - 0.5 * (time[0] + time[-1])

    def unexplained(f: float) -> float:
        phase = 2.0 * math.pi * f * around
        regressors = np.column_stack([np.ones(time.size), np.sin(phase), np.cos(phase)])
        residual = value - regressors @ np.linalg.lstsq(regressors, value, rcond=None)[0]
        return float(residual @ residual)

    low, high = max(frequency - reach, 0.1 * frequency), frequency + reach
    found = minimize_scalar(unexplained, bounds=(low, high), method="bounded", options={"xatol": 1e-9 * frequency})
    return float(found.x)
