"""Describing function of dry friction."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from idloop.estimation.describing_functions.element import Answer, check_size
from idloop.estimation.describing_functions.elements.relay import Relay
from idloop.estimation.describing_functions.harmonics import Complexes
from idloop.estimation.describing_functions.lone_effect import lone_effect


@dataclass(frozen=True)
class CoulombFriction:
    """Dry friction of a motion without sticking: force level·sign v against a velocity v = V sin ωt.

    N(V) = 4 level / (π V), the ideal relay's: a viscous friction that falls as the speed grows.
    Of the displacement's amplitude A the same force is N(A) = j 4 level / (π A) at every frequency.

    Parameters
    ----------
    level : float
        Friction force.

    Raises
    ------
    InputError
        The level is not above 0.

    References
    ----------
    Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B.
    """

    level: float
    name: str = "coulomb_friction"

    def __post_init__(self) -> None:
        check_size(self.name, "level", self.level)

    @property
    def threshold(self) -> float:
        """0: dry friction has no scale of its own."""
        return 0.0

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(V) of the velocity's amplitude, real, in the shape of ``amplitude``."""
        return Relay(self.level, name=self.name).gain(amplitude)

    def answer(self, interval: float) -> Answer:
        """The catalogue's effect under a given velocity, asked every ``interval`` seconds."""
        return lone_effect("coulomb_friction", "body", "velocity", level=self.level).answer(interval)
