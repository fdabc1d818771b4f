"""Sines of one frequency after the other, for a frequency response or a describing function."""

from __future__ import annotations

import math

import numpy as np

from idloop.arrays import Array
from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Segment, Shape, SignalKind


def generate(
    request: Request,
    *,
    frequencies: tuple[float, ...] | None,
    frequency_min: float,
    frequency_max: float | None,
    steps: int,
    spacing: str,
    periods: int,
    settle_periods: int,
) -> Shape:
    """Dwell at each frequency; the phase runs on, so the signal never jumps.

    Each frequency is moved a little so that `periods` of it fill a whole number of samples: the
    settled part of every segment can be correlated without leakage.
    """
    wanted = _frequencies(request, frequencies, frequency_min, frequency_max, steps, spacing)
    segments: list[Segment] = []
    increments: list[Array] = []
    start = 0
    for frequency in wanted:
        request.check_frequency("frequency", float(frequency))
        measured = max(round(periods * request.rate / frequency), 2 * periods)
        settling = -(-settle_periods * measured // periods)
        segments.append(
            Segment(start, start + settling, start + settling + measured, periods * request.rate / measured)
        )
        increments.append(np.full(settling + measured, periods / measured))
        start += settling + measured
    samples = start if request.samples is None else request.samples
    if start > samples:
        needed, given = start * request.sample_time, samples * request.sample_time
        raise request.error(
            f"{len(segments)} frequencies need {needed:g} s but the duration is {given:g} s; "
            "lengthen it or ask for fewer steps or periods"
        )
    step = np.concatenate(increments)
    cycles = np.cumsum(step) - step
    value = np.zeros(samples)
    value[:start] = np.sin(2.0 * math.pi * cycles)
    return Shape(value, segments=tuple(segments), derived={"frequencies": [s.frequency for s in segments]})


def _frequencies(
    request: Request, listed: tuple[float, ...] | None, low: float, high: float | None, steps: int, spacing: str
) -> Array:
    if listed is not None:
        if not listed:
            raise request.error("frequencies is empty; list at least one frequency in Hz")
        return np.asarray(listed, dtype=np.float64)
    low, high = request.band(low, high)
    return np.geomspace(low, high, steps) if spacing == "logarithmic" else np.linspace(low, high, steps)


KIND = SignalKind(
    "stepped_sine",
    "Sines of one frequency after the other; the segments are reported.",
    (
        ParameterSpec(
            "frequencies",
            "floats",
            None,
            "The frequencies in order; left out, a grid from frequency_min to frequency_max.",
            unit="Hz",
            minimum=0.0,
            exclusive=True,
        ),
        positive("frequency_min", 1.0, "First frequency of the grid.", "Hz"),
        positive("frequency_max", None, "Last frequency of the grid; left out, a tenth of the sample rate.", "Hz"),
        ParameterSpec("steps", "int", 5, "Number of frequencies of the grid.", minimum=1, maximum=10_000),
        ParameterSpec("spacing", "str", "logarithmic", "Spacing of the grid.", choices=("linear", "logarithmic")),
        ParameterSpec("periods", "int", 3, "Periods to be measured at each frequency.", minimum=1, maximum=100_000),
        ParameterSpec("settle_periods", "int", 1, "Periods left for settling before them.", minimum=0, maximum=100_000),
    ),
    generate,
    natural_length=True,
)
