"""Share of the squared error by frequency band."""

from __future__ import annotations

import itertools

import numpy as np

from idloop.arrays import Array
from idloop.validation.breakdown import Breakdown
from idloop.validation.edges import decade_edges
from idloop.validation.words import range_text


def on_even_steps(time: Array, values: Array) -> tuple[float, Array]:
    """Values at even steps; unchanged where they are even already.

    `time`, `values` (n,): finite. Returns `step`: [s]; `values` (m,).
    """
    steps = np.diff(time)
    step = float(np.median(steps))
    # The effect of stamp jitter on the shares is below their resolution.
    if np.ptp(steps) < 0.1 * step:
        return step, values
    grid = np.arange(time[0], time[-1] + 1e-6 * step, step)
    return step, np.interp(grid, time, values)


def line_powers(values: Array) -> Array:
    """Power of each line of a real signal's discrete spectrum; they add up to its mean square (Parseval)."""
    power = np.abs(np.fft.rfft(values)) ** 2 / len(values) ** 2
    doubled = slice(1, len(power) - (len(values) % 2 == 0))
    power[doubled] *= 2.0
    return np.asarray(power)


def by_frequency(time: Array, error: Array, signal: Array) -> Breakdown:
    """Share of the squared error by band, against the measured signal's power about its mean in the same band.

    `time`, `error`, `signal` (n,): finite. Returns: bands end at 1, 2, 5, 10, ... Hz; the lowest includes the mean.
    """
    step, even = on_even_steps(time, error)
    _, reference = on_even_steps(time, signal)
    frequency = np.fft.rfftfreq(len(even), step)
    size = float(np.max(np.abs(even))) or 1.0
    power = line_powers(even / size)
    usual = line_powers(reference - np.mean(reference))
    # The lowest band holds a few lines at least, the highest a fifth of the range.
    edges = np.concatenate([[0.0], decade_edges(2.5 * frequency[1], 0.8 * frequency[-1]), [frequency[-1]]])
    index = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, len(edges) - 2)
    count = len(edges) - 1
    inside = np.bincount(index, power, count)
    expected = np.bincount(index, usual, count)
    bandwidth = np.diff(edges) / edges[-1]
    total, whole = float(np.sum(inside)), float(np.sum(expected))
    names = tuple(range_text("frequency", a, b, "Hz") for a, b in itertools.pairwise(edges))
    shares = inside / total if total > 0.0 else bandwidth, expected / whole if whole > 0.0 else bandwidth
    mean, rms = np.full(count, np.nan), np.sqrt(inside) * size
    return Breakdown("frequency", "frequency", "Hz", edges, names, *shares, mean, rms)
