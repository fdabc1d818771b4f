"""Edges of bins at round numbers."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array

# Most bins of a variable, for a readable figure and text.
MOST_BINS = 12
_NOTHING = 1e-200


def round_step(span: float, most: int) -> float:
    """Smallest of 1, 2, 2.5, 5 times a power of ten that divides a span into at most so many steps."""
    least = span / most
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= least * (1.0 - 1e-9)))


def round_edges(values: Array, floor: float = 0.0) -> Array:
    """Edges at round numbers over the range of some values.

    `values` (n,): finite values; `floor`: absolute values up to this one have a bin of their own, such as standing
    among velocities. Returns shape (bins + 1,): increasing; the first and the last enclose the values approximately.
    """
    low, high = float(np.min(values)), float(np.max(values))
    # Extremes share the outermost bins and do not widen the others.
    usual = np.percentile(values, [0.5, 99.5])
    span = float(usual[1] - usual[0])
    # A smaller span is rounding of the values.
    if not span > max(1e-9 * max(abs(low), abs(high)), _NOTHING):
        return np.array([low, high if high > low else low + max(1e-9 * abs(low), 1e-12)])
    step = round_step(span, MOST_BINS - 2)
    digits = int(1 - np.floor(np.log10(step)))
    inner = np.round(step * np.arange(np.ceil(usual[0] / step), np.floor(usual[1] / step) + 1.0), digits)
    if 0.0 < floor < 0.75 * step:
        middle = np.round(floor, int(1 - np.floor(np.log10(floor))))
        inner = np.sort(np.concatenate([inner[np.abs(inner) > middle], [-middle, middle]]))
    # Narrow outermost bins join their neighbours, which include values slightly outside.
    inner = inner[(inner > low + 0.25 * step) & (inner < high - 0.25 * step)]
    first, last = step * np.floor(low / step + 0.1), step * np.ceil(high / step - 0.1)
    return np.concatenate([np.round([first], digits), inner, np.round([last], digits)])


def few_levels(values: Array) -> Array | None:
    """Levels of a signal that has no more than a dozen; None when it has more, or only one."""
    levels = np.unique(values)
    # Differences by rounding are one level.
    apart = np.diff(levels, prepend=-np.inf) > 1e-6 * (levels[-1] - levels[0])
    levels = levels[apart]
    return levels if 1 < len(levels) <= MOST_BINS else None


def level_edges(levels: Array) -> Array:
    """Edges midway between levels, at least two of them."""
    middle = 0.5 * (levels[1:] + levels[:-1])
    return np.concatenate([[2.0 * levels[0] - middle[0]], middle, [2.0 * levels[-1] - middle[-1]]])


def decade_edges(low: float, high: float) -> Array:
    """1, 2, 5, 10, ... strictly between two positive numbers."""
    if not 0.0 < low < high:
        return np.zeros(0)
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    found = np.ravel(powers[:, None] * np.array([1.0, 2.0, 5.0]))
    # Not within rounding of the ends.
    return np.asarray(found[(found > low * (1.0 + 1e-6)) & (found < high * (1.0 - 1e-6))])


def since_edges(since: Array) -> Array:
    """Edges for the time since an event: 0, then 1, 2, 5, 10, ... from where enough samples fall.

    `since` (n,): finite, not negative. Returns shape (bins + 1,).
    """
    longest = float(np.max(since))
    if longest <= 0.0:
        return np.array([0.0, 1e-12])
    # Below this a bin would contain hardly any samples. Samples at the event itself do not count.
    shortest = max(float(np.percentile(since[since > 0.0], 2.0)), 1e-4 * longest)
    inner = decade_edges(0.7 * shortest, 0.9 * longest)[1 - MOST_BINS :]
    return np.concatenate([[0.0], inner, [longest]])
