"""Constant levels, a step or pulse, and periodic waves: sine, square, saw tooth and triangle."""

from __future__ import annotations

import math

import numpy as np

from idloop.arrays import Array
from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import CYCLE_TOLERANCE, Request, Shape, SignalKind

_FREQUENCY = positive("frequency", 1.0, "Frequency of the wave.", "Hz")
_PHASE = ParameterSpec("phase", "float", 0.0, "Phase at time zero.", unit="rad")
_DUTY = ParameterSpec(
    "duty", "float", 0.5, "Share of the cycle at the upper level.", minimum=0.0, maximum=1.0, exclusive=True
)


def zero(request: Request) -> Shape:
    """Zero everywhere, to record noise, drift and the machine at rest; the offset is still added."""
    return Shape(np.zeros(request.length), period_samples=1)


def constant(request: Request) -> Shape:
    """One everywhere."""
    return Shape(np.ones(request.length), period_samples=1)


def step(request: Request, *, start: float, width: float | None) -> Shape:
    """Zero before `start`, one from `start` on and, where `width` is given, zero again after it."""
    time = request.time() + CYCLE_TOLERANCE * request.sample_time
    on = time >= start
    if width is not None:
        on &= time < start + width
    return Shape(on.astype(np.float64))


def cycle_fraction(request: Request, frequency: float, phase: float) -> Array:
    """Position within the cycle, in [0, 1), at a frequency [Hz] and a phase at time zero [rad]."""
    request.check_frequency("frequency", frequency)
    period = whole_period(request, frequency)
    index = np.arange(request.length)
    cycles = (index % period) / period if period else index * (frequency * request.sample_time)
    cycles = cycles + phase / (2.0 * math.pi)
    return np.maximum(cycles - np.floor(cycles + CYCLE_TOLERANCE), 0.0)


def whole_period(request: Request, frequency: float) -> int | None:
    """Period in samples where it is a whole number of them."""
    period = request.rate / frequency
    nearest = round(period)
    return nearest if nearest > 0 and abs(period - nearest) <= CYCLE_TOLERANCE * period else None


def sine(request: Request, *, frequency: float, phase: float) -> Shape:
    """Sine of the given frequency and phase."""
    value = np.sin(2.0 * math.pi * cycle_fraction(request, frequency, phase))
    return Shape(value, period_samples=whole_period(request, frequency))


def square(request: Request, *, frequency: float, phase: float, duty: float) -> Shape:
    """Plus one for the share `duty` of each cycle, minus one for the rest."""
    fraction = cycle_fraction(request, frequency, phase)
    # The tolerance keeps every cycle alike when an edge falls on a sample up to rounding.
    value = np.where(fraction < duty - CYCLE_TOLERANCE, 1.0, -1.0)
    return Shape(value, period_samples=whole_period(request, frequency))


def saw(request: Request, *, frequency: float, phase: float) -> Shape:
    """Rise from zero at time zero, fall at once from one to minus one in mid-cycle."""
    fraction = cycle_fraction(request, frequency, phase + math.pi)
    return Shape(2.0 * fraction - 1.0, period_samples=whole_period(request, frequency))


def triangle(request: Request, *, frequency: float, phase: float) -> Shape:
    """Constant speed in both directions, for friction and backlash; starts at zero, rising, as the sine does."""
    # A quarter cycle on, 1 - 4 |fraction - 1/2| passes zero while rising.
    fraction = cycle_fraction(request, frequency, phase + 0.5 * math.pi)
    return Shape(1.0 - 4.0 * np.abs(fraction - 0.5), period_samples=whole_period(request, frequency))


ZERO = SignalKind("zero", "Zero (plus the offset).", (), zero)
CONSTANT = SignalKind("constant", "Constant level: offset + amplitude.", (), constant)
STEP = SignalKind(
    "step",
    "Step at a given time; a pulse where a width is given.",
    (
        ParameterSpec("start", "float", 1.0, "Time of the step.", unit="s", minimum=0.0),
        positive("width", None, "Length of the pulse; left out, the step stays.", "s"),
    ),
    step,
)
SINE = SignalKind("sine", "Sine wave.", (_FREQUENCY, _PHASE), sine)
SQUARE = SignalKind("square", "Square wave.", (_FREQUENCY, _PHASE, _DUTY), square)
SAW = SignalKind("saw", "Saw-tooth wave, rising.", (_FREQUENCY, _PHASE), saw)
TRIANGLE = SignalKind("triangle", "Triangle wave.", (_FREQUENCY, _PHASE), triangle)
