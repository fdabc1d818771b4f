"""Describing function of a relay: ideal, with dead zone, with hysteresis, or with both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.errors import InputError
from idloop.estimation.describing_functions.element import Answer, check_size, positive_amplitudes
from idloop.estimation.describing_functions.harmonics import Complexes


@dataclass(frozen=True)
class Relay:
    """A switch with the outputs +level, −level and, with a dead zone, 0.

    It switches on where abs(x) rises through ``on`` and off where it falls through ``off``:
    N(A) = (2 level / π A) (√(1 − (on/A)²) + √(1 − (off/A)²)) − j (2 level / π A²) (on − off)
    above ``on``, 0 below.

    ===================  ====================
    relay                thresholds
    ===================  ====================
    ideal                on = off = 0
    with dead zone       on = off > 0
    with hysteresis      off = −on
    with both            −on < off < on
    ===================  ====================

    Parameters
    ----------
    level : float
        Output when on.
    on : float
        Input at which it switches on.
    off : float, optional
        Input at which it switches off again; ``on`` by default.

    Raises
    ------
    InputError
        The level is not above 0, or not −on ≤ off ≤ on.

    References
    ----------
    Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B; Gibson, Nonlinear
    Automatic Control, 1963. With off = −on it is python-control's ``relay_hysteresis_nonlinearity``.
    """

    level: float
    on: float = 0.0
    off: float | None = None
    name: str = "relay"

    def __post_init__(self) -> None:
        check_size(self.name, "level", self.level)
        check_size(self.name, "on", self.on, zero=True)
        if not -self.on <= self.lower <= self.on:
            raise InputError(f"{self.name}: off is {self.lower:g}; it must lie between −on and on (±{self.on:g})")

    @property
    def lower(self) -> float:
        """Input at which it switches off again."""
        return self.on if self.off is None else self.off

    @property
    def threshold(self) -> float:
        """Input at which it switches on."""
        return self.on

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A), in the shape of ``amplitude``."""
        values = positive_amplitudes(amplitude, self.name)
        on, off = np.minimum(self.on / values, 1.0), np.clip(self.lower / values, -1.0, 1.0)
        found = np.sqrt(1.0 - on**2) + np.sqrt(1.0 - off**2) - 1j * (on - off)
        found = np.where(values > self.on, 2.0 * self.level / (math.pi * values) * found, 0.0)
        return np.asarray(found, dtype=np.complex128)

    def answer(self, interval: float) -> Answer:
        """A relay that is off (with hysteresis alone: at −level), asked at any interval."""
        position = -1.0 if self.lower == -self.on and self.on > 0.0 else 0.0

        def switch(value: float, rate: float, total: float) -> float:
            nonlocal position
            # Both ways off come before the ways on, so that one sample may cross the whole dead zone.
            if (position > 0.0 and value < self.lower) or (position < 0.0 and value > -self.lower):
                position = 0.0
            if value > self.on:
                position = 1.0
            elif value < -self.on:
                position = -1.0
            return self.level * position

        return switch
