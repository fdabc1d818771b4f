"""Nonlinear elements: what one is, and those whose describing function is known in closed form.

Each raises InputError for a size that is not finite and above 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from idloop.arrays import Array, Complex
from idloop.errors import InputError
from idloop.estimation.describing_functions.effect_element import Answer, effect_element


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
    """Check amplitudes, any shape."""
    values = np.asarray(amplitude, dtype=np.float64)
    if values.size == 0 or not np.all(np.isfinite(values)) or np.any(values <= 0.0):
        raise InputError(f"{where}: amplitudes must be finite and above 0; leave the others out")
    return values


def check_size(where: str, name: str, value: float, zero: bool = False) -> None:
    """Refuse a size of an element that is not finite and positive (or zero where that makes sense)."""
    if not np.isfinite(value) or value < 0.0 or (value == 0.0 and not zero):
        raise InputError(f"{where}: {name} is {value:g}; it must be finite and {'not negative' if zero else 'above 0'}")


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

    def gain(self, amplitude: ArrayLike) -> Complex:
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
            # Off is checked before on, so that one sample may cross the whole dead zone.
            if (position > 0.0 and value < self.lower) or (position < 0.0 and value > -self.lower):
                position = 0.0
            if value > self.on:
                position = 1.0
            elif value < -self.on:
                position = -1.0
            return self.level * position

        return switch


class _OfCatalogue:
    """An element that is an effect of the catalogue, with parameters of the same names."""

    name: str
    _effect: ClassVar[tuple[str, str]]  # name and site

    def _sizes(self) -> dict[str, float]:
        """Each size of the element; one that is left out is as the first."""
        given = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "name"}  # type: ignore[arg-type]
        first = next(iter(given.values()))
        return {name: first if value is None else value for name, value in given.items()}

    def __post_init__(self) -> None:
        for name, value in self._sizes().items():
            check_size(self.name, name, value)

    @property
    def threshold(self) -> float:
        """The smallest size."""
        return min(self._sizes().values())

    def answer(self, interval: float) -> Answer:
        """The catalogue's effect, asked every ``interval`` seconds."""
        sizes: dict[str, Any] = self._sizes()
        return effect_element(*self._effect, **sizes).answer(interval)


@dataclass(frozen=True)
class Saturation(_OfCatalogue):
    """A limit of unit slope: y = clip(x, −limit, +limit).

    N(A) = (2/π) (asin r + r √(1 − r²)) with r = limit / A above the limit, 1 below (python-control's
    ``saturation_nonlinearity``; Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, appendix B).

    `limit`: in the input's unit, above 0.
    """

    limit: float
    name: str = "saturation"
    _effect = ("saturation", "input")

    def gain(self, amplitude: ArrayLike) -> Complex:
        """Describing function N(A), real, in the shape of ``amplitude``."""
        return _gain_of_control("saturation_nonlinearity", self.limit, amplitude, self.name)


@dataclass(frozen=True)
class DeadZone(_OfCatalogue):
    """Inputs within the width do nothing, larger ones act with what exceeds it.

    N(A) = 1 − (2/π) (asin r + r √(1 − r²)) with r = width / A above the width, 0 below: one less that of a limit at
    the width. Each half of the sine has its own width, so two widths give the mean (Rungroungdouyboon, Lehigh
    University 1999, eq. 6.1 with k = 1; Gelb and Vander Velde, 1968, appendix B).

    `width`: in the input's unit, above 0; `width_negative`: of negative inputs, the same by default.
    """

    width: float
    width_negative: float | None = None
    name: str = "dead_zone"
    _effect = ("dead_zone", "input")

    def gain(self, amplitude: ArrayLike) -> Complex:
        """Describing function N(A), real, in the shape of ``amplitude``."""
        values = positive_amplitudes(amplitude, self.name)
        limits = [Saturation(width).gain(values) for width in self._sizes().values()]
        return np.asarray(1.0 - 0.5 * (limits[0] + limits[1]), dtype=np.complex128)


@dataclass(frozen=True)
class FrictionBacklash(_OfCatalogue):
    """Friction-controlled backlash: the driven side stands still while the gap is crossed.

    With r = 1 − gap / A, for A above half the gap (0 below):
    Re N(A) = ½ (1 + (2/π) (asin r + r √(1 − r²))), Im N(A) = −(1 − r²) / π
    (python-control's ``friction_backlash_nonlinearity``; Gelb and Vander Velde, 1968, appendix B, no. 48). Eq. 6.2 of
    Rungroungdouyboon (Lehigh University 1999), whose A is half the gap and M the amplitude, is the real part with
    k = 1; the imaginary part, the phase lag, is not printed there.

    `gap`: full width of the gap, in the input's unit, above 0.
    """

    gap: float
    name: str = "friction_backlash"
    _effect = ("backlash", "output")

    @property
    def threshold(self) -> float:
        """Half the gap."""
        return 0.5 * self.gap

    def gain(self, amplitude: ArrayLike) -> Complex:
        """Describing function N(A), in the shape of ``amplitude``."""
        return _gain_of_control("friction_backlash_nonlinearity", self.gap, amplitude, self.name)


def _gain_of_control(nonlinearity: str, size: float, amplitude: ArrayLike, name: str) -> Complex:
    """Describing function of a nonlinearity of python-control, in the shape of ``amplitude``."""
    import control

    values = positive_amplitudes(amplitude, name)
    return np.asarray(control.describing_function(getattr(control, nonlinearity)(size), values), dtype=np.complex128)


@dataclass(frozen=True)
class InertiaBacklash:
    """Inertia-controlled backlash: the driven side coasts through the gap and does not rebound.

    It leaves its wall where the driving side begins to slow down, at phase 0 of A sin θ, coasts with the
    velocity A, and meets the other wall at the phase c with c − sin c = gap / A. The first harmonic of
    that motion is N(A) = 1 + (2 sin c − ½ sin 2c − c) / π − j (1 − cos c)² / π.

    `gap`: full width of the gap, in the input's unit. Raises InputError: the gap is not above 0.

    The wall is met before the next departure (c ≤ π) from A = gap / π on. Below there is no motion with one impact per
    half period, and ``gain`` is NaN.

    References: Gibson, Nonlinear Automatic Control, 1963, for the two kinds of backlash; the closed form is the Fourier
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

    def gain(self, amplitude: ArrayLike) -> Complex:
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
            # A wall moves the mass without rebound and releases it where the wall slows down.
            if position > value + half:
                position, velocity = value + half, min(velocity, rate)
            elif position < value - half:
                position, velocity = value - half, max(velocity, rate)
            return position

        return coast
