"""What a nonlinear element is: an answer in time, and where there is one a describing function in closed form."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from idloop.errors import InputError
from idloop.estimation.describing_functions.harmonics import Complexes, Floats


class Answer(Protocol):
    """An element at work: asked at evenly spaced instants, it answers and remembers."""

    def __call__(self, value: float, rate: float, total: float) -> float:
        """Answer to an input with its time derivative [1/s] and its integral over time [s]."""
        ...


class Element(Protocol):
    """A nonlinear element with one input and one output."""

    @property
    def name(self) -> str:
        """Name for tables and plots."""
        ...

    def answer(self, interval: float) -> Answer:
        """A fresh copy of the element, asked every ``interval`` seconds."""
        ...


class ClosedForm(Element, Protocol):
    """An element whose describing function is known in closed form and does not depend on the frequency."""

    @property
    def threshold(self) -> float:
        """Amplitude above which N(A) varies; 0 for an element without a scale, N(A) ~ 1 / A."""
        ...

    def gain(self, amplitude: ArrayLike) -> Complexes:
        """Describing function N(A) of a sine of amplitude A without bias, in the shape of ``amplitude``."""
        ...


def positive_amplitudes(amplitude: ArrayLike, where: str) -> Floats:
    """Check amplitudes, any shape.

    Raises InputError: one of them is not above zero, or not finite.
    """
    values = np.asarray(amplitude, dtype=np.float64)
    if values.size == 0 or not np.all(np.isfinite(values)) or np.any(values <= 0.0):
        raise InputError(f"{where}: amplitudes must be finite and above 0; leave the others out")
    return values


def check_size(where: str, name: str, value: float, zero: bool = False) -> None:
    """Refuse a size of an element that is not finite and positive (or zero where that makes sense)."""
    if not np.isfinite(value) or value < 0.0 or (value == 0.0 and not zero):
        raise InputError(f"{where}: {name} is {value:g}; it must be finite and {'not negative' if zero else 'above 0'}")
