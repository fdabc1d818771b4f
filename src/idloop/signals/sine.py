"""A sine wave."""

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
    """Sine of the given frequency and phase."""
    value = np.sin(2.0 * math.pi * cycle_fraction(request, frequency, phase))
    return Shape(value, period_samples=whole_period(request, frequency))


KIND = SignalKind("sine", "Sine wave.", (FREQUENCY, PHASE), generate)
