"""Excitation by a command: levels, amplitude, band, sign changes, saturation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.records.filtering import resample_held

_MANY_LEVELS = 64  # a signal with more distinct values than this counts as continuous
_LONGEST_SPECTRUM = 1 << 18


@dataclass(frozen=True)
class Excitation:
    """A command in numbers."""

    # In the command's unit
    minimum: float
    maximum: float
    mean: float
    rms: float  # root mean square about the mean
    # Largest deviation from the mean over `rms`; 1 for a two-level signal, about 1.4 for a sine. NaN when constant.
    crest_factor: float
    levels: int  # number of distinct values, at most 65: more counts as continuous
    # How often the value and its sign change
    changes: int
    sign_changes: int
    band_hz: tuple[float, float]  # band that holds the middle 90 % of the power about the mean [Hz]
    top_hz: float  # highest frequency with power within 20 dB of the strongest [Hz]
    zero_share: float  # share of the time at exactly zero
    limit_share: float  # share of the time at the largest or smallest value, zero not counted as a limit


def analyse_command(time: Array, value: Array) -> Excitation:
    """Describe a held command, shapes (m,), stamps increasing [s] and values finite."""
    step = np.diff(time)
    # Each value counts for as long as it is in force.
    weight = np.append(step, np.median(step) if step.size else 1.0)
    weight = weight / weight.sum()
    mean = float(weight @ value)
    rms = float(np.sqrt(weight @ (value - mean) ** 2))
    peak = float(np.abs(value - mean).max())
    moved = rms > 1e-12 * max(peak, float(np.abs(value).max()), 1e-300)
    band, top = _band(time, value) if moved and step.size > 8 else ((0.0, 0.0), 0.0)
    at_limit = ((value == value.max()) | (value == value.min())) & (value != 0.0)
    return Excitation(
        minimum=float(value.min()),
        maximum=float(value.max()),
        mean=mean,
        rms=rms,
        crest_factor=peak / rms if moved else float("nan"),
        levels=min(int(np.unique(value).size), _MANY_LEVELS + 1),
        changes=int(np.count_nonzero(np.diff(value))),
        sign_changes=int(np.count_nonzero(np.diff(np.sign(value[value != 0])))),
        band_hz=band,
        top_hz=top,
        zero_share=float(weight @ (value == 0)),
        limit_share=float(weight @ at_limit),
    )


def power_spectrum(time: Array, value: Array) -> tuple[Array, Array]:
    """Return frequency [Hz] and share of the power per line of a held command, mean removed."""
    period = float(np.median(np.diff(time)))
    count = min(round((time[-1] - time[0]) / period) + 1, _LONGEST_SPECTRUM)
    grid = time[0] + period * (np.arange(count) + 0.5)
    held = resample_held(time, value, grid)
    # The shares do not depend on the scale; squares of damaged values would overflow.
    held = held / max(float(np.abs(held).max()), 1e-300)
    power: Array = np.abs(np.fft.rfft(held - held.mean())) ** 2
    frequency: Array = np.arange(power.size) / (count * period)
    total = float(power.sum())
    return frequency, power / total if total > 0 else power


def _band(time: Array, value: Array) -> tuple[tuple[float, float], float]:
    frequency, power = power_spectrum(time, value)
    share = np.cumsum(power)
    if not share.size or share[-1] <= 0:
        return (0.0, 0.0), 0.0
    low, high = (float(frequency[min(int(np.searchsorted(share, level)), share.size - 1)]) for level in (0.05, 0.95))
    # Smoothed, because a long record has weak lines between strong ones.
    width = max(power.size // 200, 1)
    smooth = np.convolve(power, np.full(width, 1.0 / width), mode="same")
    return (low, high), float(frequency[np.flatnonzero(smooth >= 0.01 * smooth.max())[-1]])
