"""Constant levels: zero, a constant, a step or a pulse."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import CYCLE_TOLERANCE, Request, Shape, SignalKind


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
