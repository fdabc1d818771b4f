"""The family of experiment designs: signal shapes and bands that suit the machine.

Every shape has a peak of one: a share of the largest command, or of the room around the start. Together they contain
reversals at several speeds, standstill, coasting, a full turn, small and large levels, and bands below and above the
corner frequency.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from idloop.physics import Engine

_PER_SECOND = ("velocity_limit", "acceleration_limit")
# Shares of the amplitude at which a coast-down lets go.
_FRACTIONS = (1.0, 0.6, 0.35, 0.2, 0.1)


@dataclass(frozen=True)
class Design:
    """A shape of a signal, to be scaled."""

    name: str  # kind of the signal
    parameters: Mapping[str, Any]  # those of the kind
    amplitude: float = 1.0  # share of the peak
    offset: float = 0.0  # the rest of it
    seed: int = 0

    def signal(
        self, level: float, sample_time: float, duration: float, ramp_in: float = 0.0, about: float = 0.0
    ) -> dict[str, Any]:
        """Arguments of ``build_signal`` for a peak of `level` about `about`."""
        return {
            "name": self.name,
            "sample_time": sample_time,
            "duration": duration,
            "amplitude": _rounded(level * self.amplitude),
            "offset": _rounded(about + level * self.offset),
            "seed": self.seed,
            "ramp_in": ramp_in,
            **self.parameters,
            # The one kind whose parameters are in the unit of the amplitude.
            **{key: _rounded(level * self.parameters[key]) for key in _PER_SECOND if key in self.parameters},
        }


@dataclass(frozen=True)
class Scale:
    """Times and frequencies of a machine."""

    settling: float  # slow time constant [s]
    corner: float  # its frequency [Hz]
    resonances: tuple[float, ...]  # [Hz]
    highest: float  # highest frequency that an experiment may contain [Hz]


def machine_scale(engine: Engine, sample_time: float, duration: float | None) -> Scale:
    """Times of a machine by its linear part; `sample_time` of the signal and `duration` of the experiment [s]."""
    roots = np.linalg.eigvals(engine.linearise(None).A)
    size = np.abs(roots)
    size = size[np.isfinite(size)]
    highest = 0.2 / sample_time
    decays = -np.real(roots)
    # The integrator and its rounding are no decay.
    slow = decays[decays > 1e-6 * float(np.max(size, initial=1e-300))]
    settling = 1.0 / float(np.min(slow)) if slow.size else np.inf
    longest = 0.1 * (duration or 20.0)
    settling = float(np.clip(settling, 5.0 * sample_time, longest))
    swinging = roots[(np.imag(roots) > 0.0) & (np.abs(roots) < 2.0 * np.pi * highest)]
    resonances = sorted({round(float(abs(root)) / (2.0 * np.pi), 6) for root in swinging})
    return Scale(settling, min(1.0 / (2.0 * np.pi * settling), 0.5 * highest), tuple(resonances), highest)


def command_designs(scale: Scale, sample_time: float, duration: float) -> list[Design]:
    """Shapes for a command in open loop."""
    s, low = scale.settling, 2.0 / duration
    shortest = 2.0 * sample_time
    found = []
    for least, most in ((1.0, 4.0), (0.3, 1.0), (0.05, 0.3)):
        hold = {"hold_min": max(least * s, shortest), "hold_max": max(most * s, 2.0 * shortest)}
        found += [Design("multilevel", hold, seed=seed) for seed in (0, 1)]
    found.append(Design("multilevel", {"levels": 7, "hold_min": max(3.0 * s, shortest), "hold_max": 4.0 * s}))
    found += [Design("multisine", {"frequency_min": a, "frequency_max": b}) for a, b in _bands(scale, low)]
    for ratio in (0.3, 1.0, 3.0):
        frequency = _inside(ratio * scale.corner, low, scale.highest)
        found += [Design("square", {"frequency": frequency}), Design("sine", {"frequency": frequency})]
    found += [Design("triangle", {"frequency": f}) for f in _distinct([low, 3.0 * low, 10.0 * low], low, scale.highest)]
    # There and back again, as far as the travel allows.
    found += [Design("square", {"frequency": 1.0 / duration}), Design("square", {"frequency": low})]
    sine = {"frequency": _inside(scale.corner, low, scale.highest)}
    found.append(Design("sine", sine, amplitude=0.5, offset=0.5))
    drive = {"drive_time": max(2.0 * s, shortest), "coast_time": max(3.0 * s, shortest)}
    found += [
        Design("coast_down", {**drive, "fractions": _FRACTIONS}),
        Design(
            "coast_down",
            {**drive, "drive_time": max(s, shortest), "coast_time": max(s, shortest), "fractions": _FRACTIONS},
        ),
    ]
    return _without_repeats(found + _chirps(scale, low))


def reference_designs(scale: Scale, sample_time: float, duration: float) -> list[Design]:
    """Shapes for what a controller follows."""
    low = 2.0 / duration
    found = []
    for f in np.geomspace(low, max(scale.highest / 4.0, 2.0 * low), 5):
        frequency = float(f)
        found.append(Design("triangle", {"frequency": frequency}))
        found.append(Design("sine", {"frequency": frequency}))
        found.append(Design("multisine", {"frequency_min": 1.0 / duration, "frequency_max": 2.0 * frequency}))
    for seconds in (0.02, 0.06, 0.2):
        hold = {
            "hold_min": max(0.5 * seconds * duration, sample_time),
            "hold_max": max(seconds * duration, 2.0 * sample_time),
        }
        found += [Design("multilevel", hold, seed=seed) for seed in (0, 1)]
    found += [Design("square", {"frequency": f}) for f in _distinct([low, 4.0 * low], low, scale.highest)]
    for share in (0.3, 1.0):
        # Points over the whole travel in a few seconds each.
        pace = share * 8.0 / duration
        found.append(
            Design("smooth", {"velocity_limit": pace, "acceleration_limit": 4.0 * pace, "dwell": 0.01 * duration})
        )
    return _without_repeats(found + _chirps(scale, low))


def _chirps(scale: Scale, low: float) -> list[Design]:
    """Chirps over all frequencies, and around each resonance."""
    bands = [(low, scale.highest), *((0.3 * f, min(3.0 * f, scale.highest)) for f in scale.resonances)]
    return [Design("chirp", {"frequency_start": first, "frequency_end": last}) for first, last in bands]


def neighbours(design: Design, highest: float) -> list[Design]:
    """The same shape slightly slower, slightly faster (up to `highest` Hz), and with other random numbers."""
    times = [key for key in design.parameters if key.startswith(("hold_", "drive_time", "coast_time"))]
    rates = [key for key in design.parameters if key.startswith(("frequency", "velocity_limit"))]
    found = [
        replace(design, parameters={**design.parameters, **_times(design, keys, factor)})
        for keys in (times, rates)
        for factor in ((0.7, 1.4) if keys else ())
    ]
    if len(rates) > 1:
        found += [
            replace(design, parameters={**design.parameters, **_times(design, [rates[-1]], factor)})
            for factor in (0.6, 1.6)
        ]
    if design.name in {"multilevel", "multisine", "smooth"}:
        found += [replace(design, seed=design.seed + 10 + extra) for extra in range(2)]
    fits = [d for d in found if all(v <= highest for k, v in d.parameters.items() if k.startswith("frequency"))]
    return _without_repeats(fits)


def representatives(designs: list[Design], share: float) -> list[Design]:
    """Some of the designs: the first of every kind before the second of any."""
    rank = [(sum(other.name == design.name for other in designs[:i]), i) for i, design in enumerate(designs)]
    count = max(round(share * len(designs)), min(4, len(designs)))
    return [designs[i] for i in sorted(i for _, i in sorted(rank)[:count])]


def _times(design: Design, keys: list[str], factor: float) -> dict[str, float]:
    return {key: _rounded(design.parameters[key] * factor) for key in keys}


def _bands(scale: Scale, low: float) -> list[tuple[float, float]]:
    """Bands below, about and above the corner, at the resonances, and everything."""
    corner, highest = scale.corner, scale.highest
    edges = [(low, 2.0 * corner), (0.5 * corner, 8.0 * corner), (4.0 * corner, 40.0 * corner), (low, highest)]
    edges += [(0.4 * f, 2.5 * f) for f in scale.resonances]
    inside = [(max(a, low), min(b, highest)) for a, b in edges]
    return [(a, b) for a, b in inside if b > 1.5 * a]


def _inside(value: float, low: float, high: float) -> float:
    return float(min(max(value, low), high))


def _distinct(values: list[float], low: float, high: float) -> list[float]:
    return sorted({_inside(value, low, high) for value in values})


def _without_repeats(designs: list[Design]) -> list[Design]:
    kept: list[Design] = []
    for design in designs:
        tidy = Design(
            design.name,
            {key: _rounded(value) if isinstance(value, float) else value for key, value in design.parameters.items()},
            design.amplitude,
            design.offset,
            design.seed,
        )
        if tidy not in kept:
            kept.append(tidy)
    return kept


def _rounded(value: float) -> float:
    """Four digits: what a person would set, and the same on every machine."""
    return float(f"{value:.4g}")
