"""An element driven by one sine until its answer repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array, Complex
from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.describing_functions.element import (
    Element,
    check_size,
    distortion,
    period_harmonics,
)
from idloop.estimation.describing_functions.presentation import plain, plain_list

SAMPLES = 2048  # per period: a switch is found to 0.2 % of the period
HARMONICS = 9
MOST_PERIODS = 1000
# Change from one period to the next, of the answer's size, that counts as none; error of an extrapolated answer.
REPEATS, EXTRAPOLATED = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class SineAnswer:
    """Answer of an element to ``bias + amplitude · sin(2π frequency t)``, after the transient."""

    # Of the sine [input unit, Hz, input unit]
    amplitude: float
    frequency: float
    bias: float
    # shape (n,): one period: phase [rad], what went in and what came out
    phase: Array
    input: Array
    output: Array
    phasors: Complex  # shape (m + 1,): mean and harmonics of the output, see `period_harmonics`
    distortion: float  # total harmonic distortion: 0 for a sine, NaN for a constant
    periods: int  # periods driven until the answer repeated

    @property
    def gain(self) -> complex:
        """First harmonic over the amplitude: the describing function."""
        return complex(self.phasors[1] / self.amplitude)

    @property
    def mean(self) -> float:
        """Mean of the output."""
        return float(self.phasors[0].real)

    @property
    def harmonics(self) -> Array:
        """Size of harmonics 2, 3, ... over the first, shape (m - 1,); NaN without a first harmonic."""
        first = abs(self.phasors[1])
        if not math.isfinite(self.distortion):
            return np.full(self.phasors.size - 2, np.nan)
        return np.asarray(np.abs(self.phasors[2:]) / first, dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; a number that is not finite becomes None."""
        return {
            "amplitude": self.amplitude,
            "frequency": self.frequency,
            "bias": self.bias,
            "gain_real": self.gain.real,
            "gain_imag": self.gain.imag,
            "mean": self.mean,
            "distortion": plain(self.distortion),
            "harmonics": plain_list(self.harmonics),
            "periods": self.periods,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw input, output and the output's first harmonic over one period; returns the matplotlib axes."""
        ax = new_axes(axes)
        turn = np.degrees(self.phase)
        first = self.mean + np.imag(self.phasors[1] * np.exp(1j * self.phase))
        ax.plot(turn, self.input, color="0.6", label="input")
        ax.plot(turn, self.output, color="C0", label="output")
        ax.plot(turn, first, "--", color="C1", label="first harmonic of the output")
        ax.set(xlabel="phase of the input [°]", ylabel="value [unit of input, output]")
        ax.legend(frameon=False)
        return ax


def drive_by_sine(
    element: Element,
    amplitude: float,
    frequency: float,
    bias: float = 0.0,
    *,
    samples: int = SAMPLES,
    harmonics: int = HARMONICS,
) -> SineAnswer:
    """Drive an element alone by a sine and take the harmonics of its answer over a whole period.

    Parameters
    ----------
    element : Element
        A closed-form element or a `EffectElement`.
    amplitude, bias : float
        In the input's unit.
    frequency : float
        Hz.
    samples : int
        Per period, at least 16.
    harmonics : int
        Highest harmonic kept, at least 2.

    Raises
    ------
    InputError
        Amplitude, frequency or counts out of range.
    IdloopError
        The answer does not repeat: an element without damping, or one that drifts.
    """
    check_size(element.name, "amplitude", amplitude)
    check_size(element.name, "frequency", frequency)
    if samples < 16 or not 2 <= harmonics < samples // 2:
        raise InputError(
            f"{element.name}: {samples} samples per period and {harmonics} harmonics; take 16 and 2 or more"
        )
    omega = 2.0 * math.pi * frequency
    # Between the samples of a period: no sample falls on a corner of a symmetric element.
    phase = 2.0 * math.pi * (np.arange(samples) + 0.5) / samples
    value = bias + amplitude * np.sin(phase)
    rows = list(
        zip(
            value.tolist(),
            (amplitude * omega * np.cos(phase)).tolist(),
            (-amplitude / omega * np.cos(phase)).tolist(),
            (bias / omega * phase).tolist(),
            strict=True,
        )
    )
    answer = element.answer(1.0 / (frequency * samples))
    drift, silent = bias / frequency, math.ceil(getattr(element, "dead_time", 0.0) * frequency) + 1
    outputs: list[Array] = []
    for period in range(MOST_PERIODS + silent):
        output = np.array([answer(x, rate, total + share + drift * period) for x, rate, total, share in rows])
        # The output before the first input arrives repeats as well and must not count.
        outputs = [*outputs[-2:], output] if period >= silent else []
        settled = _settled(outputs)
        if settled is not None:
            phasors = period_harmonics(settled, phase, harmonics)
            return SineAnswer(
                amplitude,
                frequency,
                bias,
                phase,
                value,
                settled,
                phasors,
                distortion(settled, phasors[1]),
                period + 1,
            )
    raise IdloopError(
        f"{element.name}: no steady answer after {MOST_PERIODS} periods of {frequency:g} Hz; "
        "it drifts or lacks damping, or a time constant is far longer than the period"
    )


def _settled(outputs: list[Array]) -> Array | None:
    """The period that the last two or three tend to, or None while it is unknown."""
    if len(outputs) < 2:
        return None
    change, size = outputs[-1] - outputs[-2], float(np.max(np.abs(outputs[-1])))
    if float(np.max(np.abs(change))) <= REPEATS * size:
        return outputs[-1]
    if len(outputs) < 3:
        return None
    # A single time constant, however long, leaves changes that shrink by one factor.
    before = outputs[-2] - outputs[-3]
    factor = float(change @ before / (before @ before))
    rest = 1.0 - factor
    if not 0.0 < rest < 1.0 or float(np.max(np.abs(change - factor * before))) > EXTRAPOLATED * size * rest:
        return None
    limit: Array = outputs[-1] + change * factor / rest
    return limit
