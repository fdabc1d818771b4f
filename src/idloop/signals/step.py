"""A step, or a pulse where it ends again."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec
from idloop.signals.base import CYCLE_TOLERANCE, Request, Shape, SignalKind


def generate(request: Request, *, start: float, width: float | None) -> Shape:
    """Zero before `start`, one from `start` on and, where `width` is given, zero again after it."""
    tolerance = CYCLE_TOLERANCE * request.sample_time
    time = request.time() + tolerance
    on = time >= start
    if width is not None:
        on &= time < start + width
    return Shape(on.astype(np.float64))


KIND = SignalKind(
    "step",
    "Step at a given time; a pulse where a width is given.",
    (
        ParameterSpec("start", "float", 1.0, "Time of the step.", unit="s", minimum=0.0),
        ParameterSpec(
            "width",
            "float",
            None,
            "Length of the pulse; left out, the step stays.",
            unit="s",
            minimum=0.0,
            exclusive=True,
        ),
    ),
    generate,
)
