"""A triangle wave: constant speed both ways, for friction and backlash."""

from __future__ import annotations

import math

import numpy as np

from idloop.signals.base import (
    FREQUENCY,
    PHASE,
    Request,
    Shape,
    SignalKind,
    cycle_fraction,
    whole_period,
)


def generate(request: Request, *, frequency: float, phase: float) -> Shape:
    """Start at zero, rising, as the sine of the same phase does."""
    # A quarter cycle on, 1 - 4 |fraction - 1/2| passes zero while rising.
    fraction = cycle_fraction(request, frequency, phase + 0.5 * math.pi)
    return Shape(1.0 - 4.0 * np.abs(fraction - 0.5), period_samples=whole_period(request, frequency))


KIND = SignalKind("triangle", "Triangle wave.", (FREQUENCY, PHASE), generate)
