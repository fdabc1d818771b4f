"""A describing function as a table: computed, or measured, and read between its points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.arrays import Array, Complex
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.describing_functions.element import (
    ClosedForm,
    Element,
    check_size,
    positive_amplitudes,
)
from idloop.estimation.describing_functions.presentation import plain_list, with_unit
from idloop.estimation.describing_functions.sine_drive import HARMONICS, SAMPLES, drive_by_sine

# Frequencies that agree to this part are one.
SAME_FREQUENCY = 1e-3
Places = NDArray[np.intp]
# A table's own edge is part of it, whatever rounding makes of its logarithm.
_EDGE = 1e-9


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
        silent = self.gain == 0.0
        return np.where(silent, np.nan, -1.0 / np.where(silent, 1.0, self.gain))

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
        return {
            "name": self.name,
            "input_unit": self.input_unit,
            "output_unit": self.output_unit,
            "amplitude": plain_list(self.amplitude),
            "frequency": plain_list(self.frequency),
            "gain_real": plain_list(self.gain.real),
            "gain_imag": plain_list(self.gain.imag),
            "distortion": plain_list(self.distortion),
            "harmonics": [plain_list(row) for row in self.harmonics],
        }

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
        unit = f"{self.output_unit}/{self.input_unit}" if self.input_unit and self.output_unit else ""
        axes[0].set_ylabel(with_unit("|N|", unit))
        axes[1].set_ylabel("phase of N [°]")
        axes[2].set_ylabel("distortion [%]")
        axes[2].set_xlabel("frequency [Hz]" if over_frequency else with_unit("amplitude", self.input_unit))
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
    for value in given[np.isfinite(given)] if frequency is None else given:
        check_size(element.name, "frequency", float(value))
    points = [(float(a), float(f)) for f in given for a in sizes]
    # The response of a static element does not depend on the frequency: take any.
    answers = [
        drive_by_sine(element, a, f if np.isfinite(f) else 1.0, bias, samples=samples, harmonics=harmonics)
        for a, f in points
    ]
    gain = np.array([answer.gain for answer in answers], dtype=np.complex128)
    closed = closed_form(element)
    if closed is not None and not numerical and bias == 0.0:
        gain = closed.gain([a for a, _ in points])
    return DescribingFunction(
        name=element.name,
        amplitude=np.array([a for a, _ in points]),
        frequency=np.array([f for _, f in points]),
        gain=gain,
        distortion=np.array([answer.distortion for answer in answers]),
        harmonics=np.array([answer.harmonics for answer in answers]),
        input_unit=input_unit,
        output_unit=output_unit,
    )


def closed_form(element: Element | DescribingFunction) -> ClosedForm | None:
    """The element itself where its describing function is known in closed form."""
    return element if hasattr(element, "threshold") else None  # type: ignore[return-value]


class Exact:
    """Gain of an element in closed form, the same at every frequency.

    `element`: the element.
    """

    two_dimensional = False

    def __init__(self, element: ClosedForm) -> None:
        self._element = element

    def mesh(self, amplitude: ArrayLike, frequency: ArrayLike) -> Complex:
        """Gain at every amplitude (m,), shape (m, 1)."""
        return self._element.gain(amplitude)[:, None]

    def __call__(self, amplitude: float, frequency: float) -> complex:
        """Gain at one amplitude."""
        return complex(self._element.gain(amplitude))


class Interpolated:
    """Gain between the points of a table: straight lines over log amplitude, and log frequency.

    A table of one frequency counts for all. Beyond the table the gain is NaN.

    `table`: at least two amplitudes at each frequency. Raises InputError: fewer than two amplitudes at a frequency.
    """

    def __init__(self, table: DescribingFunction) -> None:
        lines = sorted(table.lines(), key=lambda line: line[0])
        if any(places.size < 2 for _, places in lines):
            raise InputError(f"{table.name}: each frequency needs two amplitudes or more, between which to look")
        self._frequency = np.log([frequency for frequency, _ in lines])
        self._lines = [(np.log(table.amplitude[places]), table.gain[places]) for _, places in lines]

    @property
    def two_dimensional(self) -> bool:
        """Whether the gain depends on the frequency too."""
        return len(self._lines) > 1

    def mesh(self, amplitude: ArrayLike, frequency: ArrayLike) -> Complex:
        """Gain at every amplitude (m,) and every frequency [Hz] (k,), shape (m, k); (m, 1) of one frequency."""
        where = np.log(np.atleast_1d(np.asarray(amplitude, dtype=float)))
        rows = np.array([self._line(x, gain, where) for x, gain in self._lines])
        if not self.two_dimensional:
            return np.asarray(rows.T, dtype=np.complex128)
        at = np.log(np.atleast_1d(np.asarray(frequency, dtype=float)))
        right = np.clip(np.searchsorted(self._frequency, at), 1, self._frequency.size - 1)
        share = (at - self._frequency[right - 1]) / (self._frequency[right] - self._frequency[right - 1])
        share = np.where((at < self._frequency[0] - _EDGE) | (at > self._frequency[-1] + _EDGE), np.nan, share)
        found = rows[right - 1].T * (1.0 - share) + rows[right].T * share
        return np.asarray(found, dtype=np.complex128)

    def __call__(self, amplitude: float, frequency: float) -> complex:
        """Gain at one amplitude and frequency [Hz]."""
        return complex(self.mesh(amplitude, frequency)[0, 0])

    @staticmethod
    def _line(x: Array, gain: Complex, where: Array) -> Complex:
        inside = (where >= x[0] - _EDGE) & (where <= x[-1] + _EDGE)
        return np.where(inside, np.interp(where, x, gain), np.nan)
