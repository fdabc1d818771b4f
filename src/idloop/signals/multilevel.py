"""Random steps over many levels, which unlike two levels excite static nonlinearities."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Segment, Shape, SignalKind


def generate(request: Request, *, levels: int, hold_min: float, hold_max: float) -> Shape:
    """Hold each level for a random time; neighbouring levels always differ."""
    if levels == 1:
        raise request.error("levels is 1, which never moves; give 0 (any level) or at least 2")
    if hold_max < hold_min:
        raise request.error(f"hold_max ({hold_max:g} s) is below hold_min ({hold_min:g} s); swap or correct them")
    count = request.length
    shortest = max(request.to_samples(hold_min), 1)
    longest = max(request.to_samples(hold_max), shortest)
    random = request.generator()
    value = np.empty(count)
    segments = []
    start, index = 0, -1
    while start < count:
        stop = min(start + int(random.integers(shortest, longest + 1)), count)
        if levels == 0:
            value[start:stop] = random.uniform(-1.0, 1.0)
        else:
            index = _another(random, levels, index)
            value[start:stop] = 2.0 * index / (levels - 1) - 1.0
        segments.append(Segment(start, start, stop))
        start = stop
    return Shape(value, segments=tuple(segments))


def _another(random: np.random.Generator, levels: int, previous: int) -> int:
    if previous < 0:
        return int(random.integers(levels))
    step = int(random.integers(1, levels))
    return (previous + step) % levels


KIND = SignalKind(
    "multilevel",
    "Random steps between many levels, each held for a random time.",
    (
        ParameterSpec("levels", "int", 0, "Number of evenly spaced levels; 0: any level.", minimum=0, maximum=10_000),
        positive("hold_min", 0.1, "Shortest time at one level.", "s"),
        positive("hold_max", 0.5, "Longest time at one level.", "s"),
    ),
    generate,
)
