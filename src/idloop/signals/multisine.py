"""Random-phase multisine on a full, odd or odd-random grid (Pintelon and Schoukens)."""

from __future__ import annotations

import math

import numpy as np

from idloop.arrays import Array, Integers
from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import LineGrid, Request, Shape, SignalKind


def harmonics(
    grid: str, lowest: int, highest: int, group: int, random: np.random.Generator
) -> tuple[Integers, Integers, Integers]:
    """Excited, odd detection and even detection harmonics between two harmonics.

    `grid`: ``full``: every harmonic; ``odd``: odd ones; ``odd_random``: odd ones without one, drawn at random, of each
    `group` neighbours. `lowest`, `highest`: first and last harmonic of the band. `group`: size of the groups of
    ``odd_random``. `random`: draws the detection lines.
    """
    every = np.arange(lowest, highest + 1, dtype=np.int64)
    none = np.empty(0, dtype=np.int64)
    if grid == "full":
        return every, none, none
    odd, even = every[every % 2 == 1], every[every % 2 == 0]
    if grid == "odd":
        return odd, none, even
    groups = odd.size // group
    left_out = np.arange(groups) * group + random.integers(0, group, groups)
    return np.delete(odd, left_out), odd[left_out], even


def sum_of_cosines(excited: Integers, phases: Array, period: int) -> Array:
    """One period of unit cosines, shape (period,)."""
    lines = np.zeros(period // 2 + 1, dtype=np.complex128)
    lines[excited] = 0.5 * period * np.exp(1j * phases)
    return np.fft.irfft(lines, period)


def crest(value: Array) -> float:
    """Peak over root mean square."""
    return float(np.max(np.abs(value)) / np.sqrt(np.mean(value**2)))


def lower_crest(excited: Integers, phases: Array, period: int, iterations: int) -> Array:
    """Phases of a lower crest factor: clip in time, restore the amplitudes in frequency."""
    best, best_crest = phases, crest(sum_of_cosines(excited, phases, period))
    for iteration in range(iterations):
        value = sum_of_cosines(excited, phases, period)
        # Clipping hard first and gently later escapes the first local minimum.
        level = (0.7 + 0.29 * iteration / iterations) * np.max(np.abs(value))
        phases = np.angle(np.fft.rfft(np.clip(value, -level, level))[excited])
        now = crest(sum_of_cosines(excited, phases, period))
        if now < best_crest:
            best, best_crest = phases, now
    return best


def generate(
    request: Request,
    *,
    period: float | None,
    frequency_min: float,
    frequency_max: float | None,
    grid: str,
    group: int,
    phases: str,
    crest_iterations: int,
) -> Shape:
    """Sum of cosines of equal amplitude, scaled to a peak of one, repeated every `period`."""
    length = request.length if period is None else request.to_samples(period)
    if length < 3:
        raise request.error("one period has fewer than 3 samples; lengthen period or duration")
    samples = length if request.samples is None else request.samples
    low, high = request.band(frequency_min, frequency_max)
    fundamental = 1.0 / (length * request.sample_time)
    lowest = max(math.ceil(low / fundamental - 1e-9), 1)
    highest = min(math.floor(high / fundamental + 1e-9), (length - 1) // 2)
    random = request.generator()
    excited, odd_detection, even_detection = harmonics(grid, lowest, highest, group, random)
    if excited.size == 0:
        raise request.error(
            f"no {grid} harmonic of {fundamental:g} Hz lies between {low:g} and {high:g} Hz; "
            "lengthen the period or widen the band"
        )
    if phases == "schroeder":
        order = np.arange(excited.size)
        angle = -math.pi * order * (order + 1) / excited.size
    else:
        angle = random.uniform(0.0, 2.0 * math.pi, excited.size)
    angle = lower_crest(excited, angle, length, crest_iterations)
    one = sum_of_cosines(excited, angle, length)
    one /= np.max(np.abs(one))
    value = np.tile(one, -(-samples // length))[:samples]
    notes: tuple[str, ...] = ()
    if samples < length:
        seconds = length * request.sample_time
        notes = (f"the duration is shorter than one period ({seconds:g} s): lines will leak",)
    return Shape(
        value,
        period_samples=length,
        lines=LineGrid(fundamental, excited, odd_detection, even_detection),
        derived={"frequency_max": high, "fundamental": fundamental, "excited_lines": int(excited.size)},
        notes=notes,
    )


KIND = SignalKind(
    "multisine",
    "Random-phase multisine; odd grids leave lines empty that show nonlinearity.",
    (
        positive("period", None, "Length of one period; left out, the whole duration.", "s"),
        ParameterSpec("frequency_min", "float", 0.0, "Lower edge of the band.", unit="Hz", minimum=0.0),
        positive("frequency_max", None, "Upper edge of the band; left out, a tenth of the sample rate.", "Hz"),
        ParameterSpec("grid", "str", "full", "Which harmonics are excited.", choices=("full", "odd", "odd_random")),
        ParameterSpec(
            "group",
            "int",
            4,
            "On the odd_random grid one of so many neighbouring odd harmonics stays empty.",
            minimum=2,
            maximum=1000,
        ),
        ParameterSpec("phases", "str", "random", "How the phases are chosen.", choices=("random", "schroeder")),
        ParameterSpec("crest_iterations", "int", 0, "Rounds of crest factor reduction.", minimum=0, maximum=10_000),
    ),
    generate,
    natural_length=True,
)
