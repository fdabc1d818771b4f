"""Drive, then coast: separates friction from effects at the input."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Segment, Shape, SignalKind


def generate(
    request: Request, *, drive_time: float, coast_time: float, fractions: tuple[float, ...], alternate: bool
) -> Shape:
    """Drive at a level for `drive_time`, command zero for `coast_time`, and so on.

    The levels are `fractions` of the amplitude in turn; with `alternate` every level is driven in
    both directions.
    """
    if not fractions:
        raise request.error("fractions is empty; list at least one share of the amplitude")
    driving = max(request.to_samples(drive_time), 1)
    coasting = max(request.to_samples(coast_time), 1)
    levels = [sign * level for level in fractions for sign in ((1.0, -1.0) if alternate else (1.0,))]
    request.checked(len(levels) * (driving + coasting))
    one = np.concatenate([np.r_[np.full(driving, level), np.zeros(coasting)] for level in levels])
    samples = one.size if request.samples is None else request.samples
    value = np.tile(one, -(-samples // one.size))[:samples]
    length = driving + coasting
    segments = tuple(
        Segment(start, min(start + driving, samples), min(start + length, samples))
        for start in range(0, samples, length)
    )
    return Shape(value, period_samples=one.size, segments=segments)


KIND = SignalKind(
    "coast_down",
    "Drive at a level, then zero command; the segments' settled part is the coasting.",
    (
        positive("drive_time", 1.0, "Time at the level.", "s"),
        positive("coast_time", 2.0, "Time at zero command.", "s"),
        ParameterSpec(
            "fractions", "floats", (1.0,), "Levels in turn, as shares of the amplitude.", minimum=-1.0, maximum=1.0
        ),
        ParameterSpec("alternate", "bool", True, "Drive every level in both directions."),
    ),
    generate,
    natural_length=True,
)
