"""What a nonlinear element is, and the harmonics of its answer to a sine."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Complex
from idloop.errors import InputError


def period_harmonics(value: Array, phase: Array, count: int) -> Complex:
    """Harmonics of one period that is sampled evenly.

    `value` (n,): samples of a whole number of periods; `phase` (n,): phase of each [rad]; `count`: highest harmonic.
    Returns shape (count + 1,): mean, then Y_k of value = mean + Σ Im(Y_k exp(j k phase)): A of A·sin(phase) is real.
    """
    order = np.arange(count + 1)
    phasors: Complex = 2j / value.size * (np.exp(-1j * np.outer(order, phase)) @ value)
    phasors[0] = value.mean()
    return phasors


def distortion(value: Array, fundamental: complex) -> float:
    """Total harmonic distortion of whole periods: rms of all harmonics above the first over that of the first.

    Returns: 0 for a sine, 0.483 for a square wave, infinite without a fundamental; NaN for a constant.
    """
    power, first = 2.0 * float(np.var(value)), abs(fundamental) ** 2
    # what rounding leaves of a constant is no oscillation
    floor = 1e-24 * float(np.max(value**2, initial=0.0))
    if power <= floor:
        return float("nan")
    return float(np.sqrt(max(power - first, 0.0) / first)) if first > floor else float("inf")


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

    def gain(self, amplitude: ArrayLike) -> Complex:
        """Describing function N(A) of a sine of amplitude A without bias, in the shape of ``amplitude``."""
        ...


def positive_amplitudes(amplitude: ArrayLike, where: str) -> Array:
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
