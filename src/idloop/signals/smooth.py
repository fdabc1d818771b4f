"""Point-to-point moves on quintic polynomials: continuous up to the acceleration."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from idloop.arrays import Array
from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Segment, Shape, SignalKind

# Largest slope and curvature of 10 s^3 - 15 s^4 + 6 s^5 on [0, 1].
PEAK_VELOCITY = 15.0 / 8.0
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)


def quintic(fraction: Array) -> tuple[Array, Array]:
    """Quintic rest-to-rest blend and its slope at `fraction` in [0, 1]."""
    blend = fraction**3 * (10.0 + fraction * (6.0 * fraction - 15.0))
    slope = 30.0 * fraction**2 * (1.0 - fraction) ** 2
    return blend, slope


def generate(
    request: Request,
    *,
    points: tuple[float, ...] | None,
    velocity_limit: float,
    acceleration_limit: float,
    dwell: float,
) -> Shape:
    """Move from zero to offset + amplitude * point, one point after the other, within the limits.

    A move that would not end within the duration is not begun: the last point is held.
    """
    if points is not None and not points:
        raise request.error("points is empty; list at least one point, as a share of the amplitude")
    if points is None and request.samples is None:
        raise request.error("random points need a duration; give it in seconds, or list the points")
    rest = request.to_samples(dwell)
    value: list[Array] = []
    rate: list[Array] = []
    segments: list[Segment] = []
    used, here = 0, 0.0
    for point in _targets(request, points):
        target = request.offset + request.amplitude * point
        distance = target - here
        duration = max(
            PEAK_VELOCITY * abs(distance) / velocity_limit,
            math.sqrt(PEAK_ACCELERATION * abs(distance) / acceleration_limit),
        )
        count = max(math.ceil(duration / request.sample_time - 1e-9), 1)
        if request.samples is not None and used + count > request.samples:
            break
        blend, slope = quintic(np.arange(count) / count)
        value += [here + distance * blend, np.full(rest, target)]
        rate += [distance * slope / (count * request.sample_time), np.zeros(rest)]
        segments.append(Segment(used, used + count, used + count + rest))
        used, here = used + count + rest, target
    if request.samples is None:
        value.append(np.array([here]))
        rate.append(np.zeros(1))
    else:
        missing = max(request.samples - used, 0)
        value.append(np.full(missing, here))
        rate.append(np.zeros(missing))
    samples = request.samples
    notes = () if segments else ("the first move does not fit the duration: nothing moves",)
    return Shape(
        np.concatenate(value)[:samples],
        rate=np.concatenate(rate)[:samples],
        segments=tuple(segments),
        notes=notes,
        absolute=True,
    )


def _targets(request: Request, points: tuple[float, ...] | None) -> Iterator[float]:
    if points is None:
        random = request.generator()
        while True:
            yield float(random.uniform(-1.0, 1.0))
    yield from points
    # Without a duration the list is run through once; with one, again and again if it moves.
    while request.samples is not None and len(set(points)) > 1:
        yield from points


KIND = SignalKind(
    "smooth",
    "Quintic point-to-point moves from rest at zero, within velocity and acceleration limits.",
    (
        ParameterSpec(
            "points",
            "floats",
            None,
            "Points in order, as shares of the amplitude about the offset; left out, random ones.",
            minimum=-1.0,
            maximum=1.0,
        ),
        positive("velocity_limit", 1.0, "Largest velocity.", "1/s"),
        positive("acceleration_limit", 10.0, "Largest acceleration.", "1/s^2"),
        ParameterSpec("dwell", "float", 0.2, "Rest at each point.", unit="s", minimum=0.0),
    ),
    generate,
    natural_length=True,
)
