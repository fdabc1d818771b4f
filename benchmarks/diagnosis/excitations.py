"""Excitations by name: commands for the open loop, references for the closed one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from machine_kind import MachineKind
from numpy.typing import NDArray

Array = NDArray[np.float64]
# From machine, level, rate, duration and seed to samples, and their velocity where it is known.
Excitation = Callable[[MachineKind, float, float, float, int], tuple[Array, Array | None]]


def _signal(name: str, rate: float, duration: float, seed: int, **parameters: Any) -> tuple[Array, Array | None]:
    from idloop.signals import build_signal

    signal = build_signal(name, sample_time=1.0 / rate, duration=duration, seed=seed, **parameters)
    return np.asarray(signal.value), signal.rate


# -- open loop: commands ------------------------------------------------------------------


def _multilevel(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Random levels, held for up to three times the machine's own time."""
    return _signal(
        "multilevel", rate, duration, seed, amplitude=m.command * level, hold_min=0.2 * m.tempo, hold_max=3.0 * m.tempo
    )


def _multisine(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """A random-phase multisine over the machine's band."""
    low, high = m.band
    return _signal(
        "multisine",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        period=0.5 * duration,
        frequency_min=low,
        frequency_max=min(high, 0.2 * rate),
        crest_iterations=20,
    )


def _chirp(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Sweeps up through the band, the second one in the other direction of motion."""
    low, high = m.band
    value, _ = _signal(
        "chirp",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        frequency_start=2.0 * low,
        frequency_end=min(high, 0.2 * rate),
        sweep_time=0.5 * duration,
    )
    half = len(value) // 2
    value[half:] *= -1.0
    return value, None


def _plateaus(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Random levels, held until the speed is constant."""
    return _signal(
        "multilevel",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        levels=9,
        hold_min=3.0 * m.tempo,
        hold_max=6.0 * m.tempo,
    )


def _coast(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Driven at several levels both ways, each followed by coasting."""
    fractions = tuple(np.random.default_rng(seed).permutation([1.0, 0.7, 0.45, 0.25]).tolist())
    return _signal(
        "coast_down",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        drive_time=2.0 * m.tempo,
        coast_time=2.0 * m.tempo,
        fractions=fractions,
    )


def _two_level(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """A pseudorandom binary sequence: nothing but two levels."""
    value, _ = _signal("prbs", rate, duration, seed, amplitude=m.command * level, band_hz=1.0 / m.tempo)
    return np.where(value >= 0.0, m.command * level, -m.command * level), None


def _one_way(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Random levels between 60 and 100 % in one direction."""
    value, _ = _multilevel(m, level, rate, duration, seed)
    return 0.8 * m.command * level + 0.2 * value, None


def _slow_sines(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """A multisine far below everything fast in the machine."""
    return _signal(
        "multisine",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        period=duration,
        frequency_min=0.0,
        frequency_max=max(0.15 / m.tempo, 3.0 / duration),
    )


def _crawl(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """A fast multisine that hardly moves the machine off its place."""
    low, high = m.band
    return _signal(
        "multisine",
        rate,
        duration,
        seed,
        amplitude=m.command * level,
        period=0.25 * duration,
        frequency_min=max(2.0 / m.tempo, 10.0 * low),
        frequency_max=min(max(high, 8.0 / m.tempo), 0.2 * rate),
        crest_iterations=20,
    )


# -- closed loop: references --------------------------------------------------------------


def _moves(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Smooth point-to-point moves."""
    return _signal(
        "smooth",
        rate,
        duration,
        seed,
        amplitude=m.reference * level,
        velocity_limit=m.speed * level,
        acceleration_limit=m.acceleration * level,
        dwell=0.5 * m.tempo,
    )


def _slow_moves(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Smooth moves at a fifth of the usual speed."""
    return _signal(
        "smooth",
        rate,
        duration,
        seed,
        amplitude=0.5 * m.reference * level,
        velocity_limit=0.2 * m.speed * level,
        acceleration_limit=0.3 * m.acceleration * level,
        dwell=0.2 * m.tempo,
    )


def _reference_sines(
    m: MachineKind, level: float, rate: float, duration: float, seed: int
) -> tuple[Array, Array | None]:
    """A multisine reference."""
    return _signal(
        "multisine",
        rate,
        duration,
        seed,
        amplitude=0.3 * m.reference * level,
        period=0.5 * duration,
        frequency_min=0.0,
        frequency_max=1.0 / m.tempo,
        crest_iterations=20,
    )


def _reference_steps(
    m: MachineKind, level: float, rate: float, duration: float, seed: int
) -> tuple[Array, Array | None]:
    """A reference of random steps."""
    return _signal(
        "multilevel",
        rate,
        duration,
        seed,
        amplitude=0.15 * m.reference * level,
        hold_min=m.tempo,
        hold_max=4.0 * m.tempo,
    )


def _speeds(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """Ramps: constant speeds of both signs, long enough for several turns."""
    speed, _ = _signal(
        "multilevel",
        rate,
        duration,
        seed,
        amplitude=0.6 * m.speed * level,
        levels=9,
        hold_min=3.0 * m.tempo,
        hold_max=6.0 * m.tempo,
    )
    return np.cumsum(speed) / rate, speed


def _small(m: MachineKind, level: float, rate: float, duration: float, seed: int) -> tuple[Array, Array | None]:
    """A multisine reference of a few degrees."""
    return _signal(
        "multisine",
        rate,
        duration,
        seed,
        amplitude=0.15 * level,
        period=0.5 * duration,
        frequency_min=0.0,
        frequency_max=1.0 / m.tempo,
        crest_iterations=20,
    )


OPEN: Mapping[str, Excitation] = {
    "multilevel": _multilevel,
    "multisine": _multisine,
    "chirp": _chirp,
    "plateaus": _plateaus,
    "coast": _coast,
    "two_level": _two_level,
    "one_way": _one_way,
    "slow_sines": _slow_sines,
    "crawl": _crawl,
}
CLOSED: Mapping[str, Excitation] = {
    "moves": _moves,
    "slow_moves": _slow_moves,
    "reference_sines": _reference_sines,
    "reference_steps": _reference_steps,
    "speeds": _speeds,
    "small": _small,
}
EXCITATIONS: Mapping[str, Excitation] = {**OPEN, **CLOSED}
