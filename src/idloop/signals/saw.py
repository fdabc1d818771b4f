"""A saw-tooth wave."""

from __future__ import annotations

import math

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
    """Rise from zero at time zero, fall at once from one to minus one in mid-cycle."""
    fraction = cycle_fraction(request, frequency, phase + math.pi)
    return Shape(2.0 * fraction - 1.0, period_samples=whole_period(request, frequency))


KIND = SignalKind("saw", "Saw-tooth wave, rising.", (FREQUENCY, PHASE), generate)
