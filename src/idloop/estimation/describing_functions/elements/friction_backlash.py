"""Describing function of backlash whose driven side is held by friction: the play."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.estimation.describing_functions.element import Answer, check_size, positive_amplitudes
from idloop.estimation.describing_functions.harmonics import Complexes
from idloop.estimation.describing_functions.lone_effect import lone_effect


@dataclass(frozen=True)
class FrictionBacklash:
    """Friction-controlled backlash: the driven side stands still while the gap is crossed.

    With r = 1 − gap / A, for A above half the gap (0 below):
    Re N(A) = ½ (1 + (2/π) (asin r + r √(1 − r²))), Im N(A) = −(1 − r²) / π.

    Parameters
    ----------
    gap : float
        Full width of the gap, in the input's unit.

    Raises
    ------
    InputError
        The gap is not above 0.

    Notes
    -----
    Eq. 6.2 of Rungroungdouyboon (Lehigh University 1999), whose A is half the gap and M the amplitude, is the
    real part with k = 1; the imaginary part, the phase lag, is not printed there.

    References
    ----------
    Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B, no. 48; python-control's
    ``friction_backlash_nonlinearity`` evaluates it.
    """

    gap: float
    name: str = "friction_backlash"

    def __post_init__(self) -> None:
        check_size(self.name, "gap", self.gap)

    @property
    def threshold(self) -> float:
        """Half the gap."""
        return 0.5 * self.gap

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A), in the shape of ``amplitude``."""
        import control

        values = positive_amplitudes(amplitude, self.name)
        found = control.describing_function(control.friction_backlash_nonlinearity(self.gap), values)
        return np.asarray(found, dtype=np.complex128)

    def answer(self, interval: float) -> Answer:
        """The catalogue's effect, asked every ``interval`` seconds."""
        return lone_effect("backlash", "output", gap=self.gap).answer(interval)
