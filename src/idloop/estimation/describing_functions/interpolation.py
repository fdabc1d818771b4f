"""A describing function at any amplitude and frequency: in closed form, or between the points of a table."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from idloop.errors import InputError
from idloop.estimation.describing_functions.describing_function import DescribingFunction
from idloop.estimation.describing_functions.element import ClosedForm
from idloop.estimation.describing_functions.harmonics import Complexes, Floats

# A table's own edge is part of it, whatever rounding makes of its logarithm.
_EDGE = 1e-9


class Exact:
    """Gain of an element in closed form, the same at every frequency.

    `element`: the element.
    """

    two_dimensional = False

    def __init__(self, element: ClosedForm) -> None:
        self._element = element

    def mesh(self, amplitude: ArrayLike, frequency: ArrayLike) -> Complexes:
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

    def mesh(self, amplitude: ArrayLike, frequency: ArrayLike) -> Complexes:
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
    def _line(x: Floats, gain: Complexes, where: Floats) -> Complexes:
        inside = (where >= x[0] - _EDGE) & (where <= x[-1] + _EDGE)
        return np.where(inside, np.interp(where, x, gain), np.nan)
