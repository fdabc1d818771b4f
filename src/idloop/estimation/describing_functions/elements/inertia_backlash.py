"""Describing function of backlash whose driven side is held by nothing but its inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from idloop.estimation.describing_functions.element import Answer, check_size, positive_amplitudes
from idloop.estimation.describing_functions.harmonics import Complexes


@dataclass(frozen=True)
class InertiaBacklash:
    """Inertia-controlled backlash: the driven side coasts through the gap and does not rebound.

    It leaves its wall where the driving side begins to slow down, at phase 0 of A sin θ, coasts with the
    velocity A, and meets the other wall at the phase c with c − sin c = gap / A. The first harmonic of
    that motion is N(A) = 1 + (2 sin c − ½ sin 2c − c) / π − j (1 − cos c)² / π.

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
    The wall is met before the next departure (c ≤ π) from A = gap / π on. Below there is no motion with one
    impact per half period, and ``gain`` is NaN.

    References
    ----------
    Gibson, Nonlinear Automatic Control, 1963, for the two kinds of backlash; the closed form is the Fourier
    integral of the motion above.
    """

    gap: float
    name: str = "inertia_backlash"

    def __post_init__(self) -> None:
        check_size(self.name, "gap", self.gap)

    @property
    def threshold(self) -> float:
        """The smallest amplitude with one impact per half period."""
        return self.gap / math.pi

    def contact(self, amplitude: float) -> float:
        """Phase at which the other wall is met [rad]; NaN below the smallest amplitude."""
        ratio = self.gap / amplitude
        if ratio > math.pi:
            return float("nan")
        return float(brentq(lambda c: c - math.sin(c) - ratio, 0.0, math.pi, xtol=1e-14))

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A), in the shape of ``amplitude``; NaN below gap / π."""
        values = positive_amplitudes(amplitude, self.name)
        c = np.vectorize(self.contact, otypes=[float])(values)
        found = 1.0 + (2.0 * np.sin(c) - 0.5 * np.sin(2.0 * c) - c) / math.pi - 1j * (1.0 - np.cos(c)) ** 2 / math.pi
        return np.asarray(found, dtype=np.complex128)

    def answer(self, interval: float) -> Answer:
        """A free mass between two walls, asked every ``interval`` seconds; in the middle and moving along at first."""
        half = 0.5 * self.gap
        position = velocity = 0.0
        started = False

        def coast(value: float, rate: float, total: float) -> float:
            nonlocal position, velocity, started
            if not started:
                position, velocity, started = value, rate, True
                return position
            position += velocity * interval
            # A wall takes the mass along without a rebound, and lets go where it begins to lag behind.
            if position > value + half:
                position, velocity = value + half, min(velocity, rate)
            elif position < value - half:
                position, velocity = value - half, max(velocity, rate)
            return position

        return coast
