"""A constant level."""

from __future__ import annotations

import numpy as np

from idloop.signals.base import Request, Shape, SignalKind


def generate(request: Request) -> Shape:
    """One everywhere."""
    return Shape(np.ones(request.length), period_samples=1)


KIND = SignalKind("constant", "Constant level: offset + amplitude.", (), generate)
