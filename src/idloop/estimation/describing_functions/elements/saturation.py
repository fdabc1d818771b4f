"""Describing function of a limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.estimation.describing_functions.element import Answer, check_size, positive_amplitudes
from idloop.estimation.describing_functions.harmonics import Complexes
from idloop.estimation.describing_functions.lone_effect import lone_effect


@dataclass(frozen=True)
class Saturation:
    """A limit of unit slope: y = clip(x, −limit, +limit).

    N(A) = (2/π) (asin r + r √(1 − r²)) with r = limit / A above the limit, 1 below.

    Parameters
    ----------
    limit : float
        In the input's unit.

    Raises
    ------
    InputError
        The limit is not above 0.

    References
    ----------
    Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B; python-control's
    ``saturation_nonlinearity`` evaluates it.
    """

    limit: float
    name: str = "saturation"

    def __post_init__(self) -> None:
        check_size(self.name, "limit", self.limit)

    @property
    def threshold(self) -> float:
        """The limit."""
        return self.limit

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A), real, in the shape of ``amplitude``."""
        import control

        values = positive_amplitudes(amplitude, self.name)
        found = control.describing_function(control.saturation_nonlinearity(self.limit), values)
        return np.asarray(found, dtype=np.complex128)

    def answer(self, interval: float) -> Answer:
        """The catalogue's effect, asked every ``interval`` seconds."""
        return lone_effect("saturation", "input", limit=self.limit).answer(interval)
