"""The describing function of an element: driven by a sine until its answer repeats, and tabulated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.arrays import Array, Complex
from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.describing_functions.elements import ClosedForm, Element, check_size, positive_amplitudes
from idloop.json_values import to_json

SAMPLES = 2048  # per period: a switch is found to 0.2 % of the period
HARMONICS = 9
MOST_PERIODS = 1000
# Change from one period to the next, of the answer's size, that counts as none; error of an extrapolated answer.
REPEATS, EXTRAPOLATED = 1e-9, 1e-6
# Frequencies that agree to this part are one.
SAME_FREQUENCY = 1e-3
Places = NDArray[np.intp]


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
    phasors: Complex  # shape (m + 1,): mean, then Y_k of output = mean + Σ Im(Y_k exp(j k phase))
    distortion: float  # total harmonic distortion: 0 for a sine, 0.483 for a square wave, NaN for a constant
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
        if not math.isfinite(self.distortion):
            return np.full(self.phasors.size - 2, np.nan)
        return np.asarray(np.abs(self.phasors[2:]) / abs(self.phasors[1]), dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; a number that is not finite becomes None."""
        names = ("amplitude", "frequency", "bias", "mean", "distortion", "harmonics", "periods")
        values = {name: getattr(self, name) for name in names}
        return dict(to_json({**values, "gain_real": self.gain.real, "gain_imag": self.gain.imag}))

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

    `element`: a closed-form element or a `EffectElement`; `amplitude`, `bias`: in the input's unit; `frequency`: Hz;
    `samples`: per period, at least 16; `harmonics`: highest harmonic kept, at least 2. Raises InputError: amplitude,
    frequency or counts out of range. Raises IdloopError: the answer does not repeat: an element without damping, or one
    that drifts.
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
    rate, total = amplitude * omega * np.cos(phase), (bias * phase - amplitude * np.cos(phase)) / omega
    rows = list(zip(value.tolist(), rate.tolist(), total.tolist(), strict=True))
    answer = element.answer(1.0 / (frequency * samples))
    drift, silent = bias / frequency, math.ceil(getattr(element, "dead_time", 0.0) * frequency) + 1
    outputs: list[Array] = []
    for period in range(MOST_PERIODS + silent):
        output = np.array([answer(x, speed, place + drift * period) for x, speed, place in rows])
        # The output before the first input arrives repeats as well and must not count.
        outputs = [*outputs[-2:], output] if period >= silent else []
        settled = _settled(outputs)
        if settled is not None:
            phasors = 2j / samples * (np.exp(-1j * np.outer(np.arange(harmonics + 1), phase)) @ settled)
            phasors[0] = settled.mean()
            left = _distortion(settled, abs(phasors[1]) ** 2)
            return SineAnswer(amplitude, frequency, bias, phase, value, settled, phasors, left, period + 1)
    raise IdloopError(
        f"{element.name}: no steady answer after {MOST_PERIODS} periods of {frequency:g} Hz; "
        "it drifts or lacks damping, or a time constant is far longer than the period"
    )


def _distortion(value: Array, first: float) -> float:
    """Rms of all harmonics above the first over that of the first, whose squared size is given."""
    power = 2.0 * float(np.var(value))
    # What rounding leaves of a constant is no oscillation.
    floor = 1e-24 * float(np.max(value**2, initial=0.0))
    if power <= floor:
        return float("nan")
    return math.sqrt(max(power - first, 0.0) / first) if first > floor else float("inf")


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


@dataclass(frozen=True, eq=False, kw_only=True)
class DescribingFunction:
    """Complex gain N(A, f) from a sine to the first harmonic of the answer, point by point."""

    name: str  # of the element or of the pair of signals
    amplitude: Array  # shape (n,): of the sine [input unit]
    frequency: Array  # shape (n,): Hz; NaN where the gain does not depend on it
    gain: Complex  # shape (n,): phase of the answer against the input's [output unit / input unit]
    # shape (n,): total harmonic distortion of the answer: where it is small (and what follows is a low-pass), the
    # harmonic assumption holds. NaN for a constant answer.
    distortion: Array
    # shape (n, m): size of harmonics 2, 3, ... over the first; NaN where not known.
    harmonics: Array
    # Empty where not known
    input_unit: str = ""
    output_unit: str = ""

    @property
    def locus(self) -> Complex:
        """Critical locus −1/N, shape (n,); NaN where nothing passes."""
        return np.asarray(-1.0 / np.where(self.gain == 0.0, np.nan, self.gain), dtype=np.complex128)

    def lines(self) -> Iterator[tuple[float, Places]]:
        """Each frequency [Hz] with the places of its points, by growing amplitude."""
        left = np.argsort(self.amplitude, kind="stable")
        while left.size:
            frequency = float(self.frequency[left].min()) if np.isfinite(self.frequency[left]).any() else float("nan")
            same = np.isclose(self.frequency[left], frequency, rtol=SAME_FREQUENCY, atol=0.0, equal_nan=True)
            yield frequency, left[same]
            left = left[~same]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; numbers that are not finite become None."""
        names = ("name", "input_unit", "output_unit", "amplitude", "frequency", "distortion", "harmonics")
        values = {name: getattr(self, name) for name in names}
        return dict(to_json({**values, "gain_real": self.gain.real, "gain_imag": self.gain.imag}))

    def plot(self, axes: Any = None) -> Any:
        """Draw size, phase and distortion over the amplitude; returns the three matplotlib axes.

        Over the frequency where each amplitude has more frequencies than the other way round.
        """
        axes = new_axes(axes, rows=3, height=7.0)
        # Amplitudes that were meant to be equal are measured a little apart.
        amplitudes = np.unique(np.round(20.0 * np.log10(self.amplitude))).size
        over_frequency = amplitudes < sum(1 for _ in self.lines())
        if over_frequency:
            order = np.argsort(self.frequency, kind="stable")
            self._draw(axes, self.frequency[order], order, self.name)
        else:
            for frequency, places in self.lines():
                label = self.name if np.isnan(frequency) else f"{self.name}, {frequency:.4g} Hz"
                self._draw(axes, self.amplitude[places], places, label)
        unit = f" [{self.output_unit}/{self.input_unit}]" if self.input_unit and self.output_unit else ""
        axes[0].set_ylabel(f"|N|{unit}")
        axes[1].set_ylabel("phase of N [°]")
        axes[2].set_ylabel("distortion [%]")
        own = f" [{self.input_unit}]" if self.input_unit else ""
        axes[2].set_xlabel("frequency [Hz]" if over_frequency else f"amplitude{own}")
        axes[0].legend(frameon=False)
        return axes

    def _draw(self, axes: Any, x: Array, places: Places, label: str) -> None:
        gain = np.where(self.gain[places] == 0.0, np.nan, self.gain[places])
        axes[0].plot(x, np.abs(self.gain[places]), ".-", label=label)
        axes[1].plot(x, np.degrees(np.angle(gain)), ".-", label=label)
        distortion = self.distortion[places]
        axes[2].plot(x, 100.0 * np.where(np.isfinite(distortion), distortion, np.nan), ".-", label=label)


def describing_function(
    element: Element,
    amplitude: ArrayLike,
    frequency: ArrayLike | None = None,
    *,
    bias: float = 0.0,
    numerical: bool = False,
    samples: int = SAMPLES,
    harmonics: int = HARMONICS,
    input_unit: str = "",
    output_unit: str = "",
) -> DescribingFunction:
    """Tabulate the describing function of an element over amplitudes, and frequencies.

    Parameters
    ----------
    element : Element
        A closed-form element, or a `EffectElement`, whose answer is computed in time.
    amplitude : array_like, shape (m,)
        Input unit.
    frequency : array_like, shape (k,), optional
        Hz. Left out, the gain counts as the same at every frequency; with it, every amplitude is
        computed at every frequency, m·k points.
    bias : float
        Mean of the input, for an element that works around a point.
    numerical : bool
        Compute the gain in time even where a closed form is known (as with a bias).
    samples, harmonics : int
        Samples per period, and highest harmonic kept.
    input_unit, output_unit : str
        For labels.

    Raises
    ------
    InputError
        An amplitude or frequency is not finite and above 0, or the frequency is missing for an element
        with a clock of its own (delay, lag, filter, a force of a motion).
    IdloopError
        The answer never repeats.

    Examples
    --------
    >>> from idloop.estimation.describing_functions import DeadZone
    >>> table = describing_function(DeadZone(0.12), [0.1, 0.24, 1.2])
    >>> [round(float(abs(gain)), 3) for gain in table.gain]
    [0.0, 0.391, 0.873]
    """
    sizes = np.atleast_1d(positive_amplitudes(amplitude, element.name)).ravel()
    given = np.array([np.nan]) if frequency is None else np.atleast_1d(np.asarray(frequency, dtype=float)).ravel()
    if frequency is None and getattr(element, "needs_frequency", False):
        raise InputError(f"{element.name}: the answer depends on the frequency; give it in Hz")
    if frequency is not None:
        for value in given:
            check_size(element.name, "frequency", float(value))
    frequencies, amplitudes = np.repeat(given, sizes.size), np.tile(sizes, given.size)
    # The response of a static element does not depend on the frequency: take any.
    answers = [
        drive_by_sine(element, float(a), float(f), bias, samples=samples, harmonics=harmonics)
        for a, f in zip(amplitudes, np.nan_to_num(frequencies, nan=1.0), strict=True)
    ]
    gain = np.array([answer.gain for answer in answers], dtype=np.complex128)
    closed = closed_form(element)
    if closed is not None and not numerical and bias == 0.0:
        gain = closed.gain(amplitudes)
    return DescribingFunction(
        name=element.name,
        amplitude=amplitudes,
        frequency=frequencies,
        gain=gain,
        distortion=np.array([answer.distortion for answer in answers]),
        harmonics=np.array([answer.harmonics for answer in answers]),
        input_unit=input_unit,
        output_unit=output_unit,
    )


def closed_form(element: Element | DescribingFunction) -> ClosedForm | None:
    """The element itself where its describing function is known in closed form."""
    return element if hasattr(element, "threshold") else None  # type: ignore[return-value]
