"""Nothing at all: for recording noise, drift and the machine at rest."""

from __future__ import annotations

import numpy as np

from idloop.signals.base import Request, Shape, SignalKind


def generate(request: Request) -> Shape:
    """Zero everywhere; the offset is still added."""
    return Shape(np.zeros(request.length), period_samples=1)


KIND = SignalKind("zero", "Zero (plus the offset).", (), generate)
