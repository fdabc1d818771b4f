"""A square wave."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec
from idloop.signals.base import (
    FREQUENCY,
    PHASE,
    Request,
    Shape,
    SignalKind,
    cycle_fraction,
    whole_period,
)


def generate(request: Request, *, frequency: float, phase: float, duty: float) -> Shape:
    """Plus one for the share `duty` of each cycle, minus one for the rest."""
    fraction = cycle_fraction(request, frequency, phase)
    # The tolerance keeps every cycle alike when an edge falls on a sample up to rounding.
    value = np.where(fraction < duty - 1e-9, 1.0, -1.0)
    return Shape(value, period_samples=whole_period(request, frequency))


KIND = SignalKind(
    "square",
    "Square wave.",
    (
        FREQUENCY,
        PHASE,
        ParameterSpec(
            "duty",
            "float",
            0.5,
            "Share of the cycle at the upper level.",
            minimum=0.0,
            maximum=1.0,
            exclusive=True,
        ),
    ),
    generate,
)
