"""Quantum and measurement noise of an output, from its samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array

# Variance of the third difference of unit white noise: 1 + 9 + 9 + 1.
_THIRD_DIFFERENCE_VARIANCE = 20.0
# Median absolute value of a standard normal variable.
_MEDIAN_OF_NORMAL = 0.6744897501960817
# Least number of gaps that show a quantisation.
_ENOUGH_GAPS = 20


def resolution(values: ArrayLike) -> float:
    """Quantum of a digital sensor, the smallest step between different values (n,); 0 without quantisation."""
    y = np.asarray(values, dtype=float)
    y = y[np.isfinite(y)]
    levels = np.unique(y)
    gaps = np.diff(levels)
    # Gaps of one quantum differ in the last digits by rounding of the file format.
    gaps = gaps[gaps > 1e-9 * np.ptp(y)] if len(gaps) else gaps
    if not len(gaps):
        return 0.0
    if len(levels) > 0.5 * len(y) and not _multiples_of_smallest(gaps):
        return 0.0
    return float(np.percentile(gaps, 5.0))


def _multiples_of_smallest(gaps: Array) -> bool:
    """Whether gaps are integer multiples of the smallest: quantised values that hardly repeat, as in a fast sweep."""
    if len(gaps) < _ENOUGH_GAPS:
        return False
    multiples = gaps / np.min(gaps)
    off = np.abs(multiples - np.round(multiples))
    return bool(np.percentile(multiples, 5.0) < 1.5 and np.mean(off < 0.02) > 0.99)


def noise_std(values: ArrayLike) -> float:
    """Standard deviation of the white part of the measurement noise.

    Third differences remove the motion over four samples; their median absolute value ignores the few samples of fast
    changes.

    `values` (n,): measured output at a constant rate; NaN samples are left out.
    Returns: at least that of rounding to the quantum, and 1e-9 of the range of values; 0 for fewer than 8 samples.
    """
    y = np.asarray(values, dtype=float)
    y = y[np.isfinite(y)]
    if len(y) < 8:
        return 0.0
    span = float(np.ptp(y))
    high = np.abs(np.diff(y, 3))
    deviation = float(np.median(high)) / _MEDIAN_OF_NORMAL
    deviation = max(deviation / np.sqrt(_THIRD_DIFFERENCE_VARIANCE), resolution(y) / np.sqrt(12.0))
    return float(max(deviation, 1e-9 * span))
