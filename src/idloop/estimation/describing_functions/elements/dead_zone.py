"""Describing function of a dead zone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.estimation.describing_functions.element import Answer, check_size, positive_amplitudes
from idloop.estimation.describing_functions.elements.saturation import Saturation
from idloop.estimation.describing_functions.harmonics import Complexes
from idloop.estimation.describing_functions.lone_effect import lone_effect


@dataclass(frozen=True)
class DeadZone:
    """Inputs within the width do nothing, larger ones act with what exceeds it.

    N(A) = 1 − (2/π) (asin r + r √(1 − r²)) with r = width / A above the width, 0 below: what a
    limit at the width cuts off. Each half of the sine sees its own width, so two widths give the mean.

    Parameters
    ----------
    width : float
        In the input's unit.
    width_negative : float, optional
        Of negative inputs; the same by default.

    Raises
    ------
    InputError
        A width is not above 0.

    References
    ----------
    Rungroungdouyboon, Lehigh University 1999, eq. 6.1 (with k = 1); Gelb and Vander Velde, Multiple-Input
    Describing Functions, 1968, appendix B.
    """

    width: float
    width_negative: float | None = None
    name: str = "dead_zone"

    def __post_init__(self) -> None:
        check_size(self.name, "width", self.width)
        check_size(self.name, "width_negative", self._negative)

    @property
    def _negative(self) -> float:
        return self.width if self.width_negative is None else self.width_negative

    @property
    def threshold(self) -> float:
        """The smaller width."""
        return min(self.width, self._negative)

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A), real, in the shape of ``amplitude``."""
        values = positive_amplitudes(amplitude, self.name)
        cut_off = [Saturation(width).gain(values) for width in (self.width, self._negative)]
        return np.asarray(1.0 - 0.5 * (cut_off[0] + cut_off[1]), dtype=np.complex128)

    def answer(self, interval: float) -> Answer:
        """The catalogue's effect, asked every ``interval`` seconds."""
        effect = lone_effect("dead_zone", "input", width=self.width, width_negative=self._negative)
        return effect.answer(interval)
