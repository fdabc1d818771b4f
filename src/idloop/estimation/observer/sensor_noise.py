"""Measurement noise of an output, read off the data's own high-frequency part."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Variance of the third difference of unit white noise: 1 + 9 + 9 + 1.
_THIRD_DIFFERENCE_VARIANCE = 20.0
# Median absolute value of a standard normal variable.
_MEDIAN_OF_NORMAL = 0.6744897501960817
# Fewer gaps may be multiples of one by chance.
_ENOUGH_GAPS = 20


def resolution(values: ArrayLike) -> float:
    """Smallest step between different values: the quantum of a digital sensor.

    Parameters
    ----------
    values : array, shape (n,)
        Measured output; NaN samples are left out.

    Returns
    -------
    float
        Quantum in the output's unit; 0 when values hardly ever repeat and lie on no lattice.
    """
    y = np.asarray(values, dtype=float)
    y = y[np.isfinite(y)]
    levels = np.unique(y)
    gaps = np.diff(levels)
    # Rounding in the file format makes gaps of one quantum differ in the last digits.
    gaps = gaps[gaps > 1e-9 * np.ptp(y)] if len(gaps) else gaps
    if not len(gaps):
        return 0.0
    if len(levels) > 0.5 * len(y) and not _on_lattice(gaps):
        return 0.0
    return float(np.percentile(gaps, 5.0))


def _on_lattice(gaps: Array) -> bool:
    """Whether gaps between values that hardly repeat are whole multiples of the smallest: a fast sweep of a scale."""
    if len(gaps) < _ENOUGH_GAPS:
        return False
    multiples = gaps / np.min(gaps)
    off = np.abs(multiples - np.round(multiples))
    return bool(np.percentile(multiples, 5.0) < 1.5 and np.mean(off < 0.02) > 0.99)


def noise_std(values: ArrayLike) -> float:
    """Standard deviation of the white part of the measurement noise.

    Third differences remove what a motion does in four samples; their median
    absolute value is blind to the few samples at which the motion jerks.

    Parameters
    ----------
    values : array, shape (n,)
        Measured output at a steady rate; NaN samples are left out.

    Returns
    -------
    float
        Standard deviation in the output's unit, never below that of rounding to
        the quantum or 1e-9 of the signal's span.
    """
    y = np.asarray(values, dtype=float)
    y = y[np.isfinite(y)]
    if len(y) < 8:
        return 0.0
    span = float(np.ptp(y))
    high = np.abs(np.diff(y, 3))
    spread = float(np.median(high)) / _MEDIAN_OF_NORMAL
    spread = max(spread / np.sqrt(_THIRD_DIFFERENCE_VARIANCE), resolution(y) / np.sqrt(12.0))
    return float(max(spread, 1e-9 * span))
