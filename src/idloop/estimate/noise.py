"""Measurement noise of an output, read off the data's own high-frequency part."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Variance of the third difference of unit white noise: 1 + 9 + 9 + 1.
_THIRD_DIFFERENCE_VARIANCE = 20.0
# Median absolute value of a standard normal variable.
_MEDIAN_OF_NORMAL = 0.6744897501960817


def resolution(values: ArrayLike) -> float:
    """Smallest step between different values: the quantum of a digital sensor.

    Parameters
    ----------
    values : array, shape (n,)
        Measured output; NaN samples are left out.

    Returns
    -------
    float
        Quantum in the output's unit; 0 when values hardly ever repeat.
    """
    y = np.asarray(values, dtype=float)
    y = y[np.isfinite(y)]
    levels = np.unique(y)
    if len(levels) < 2 or len(levels) > 0.5 * len(y):
        return 0.0
    gaps = np.diff(levels)
    # Rounding in the file format makes gaps of one quantum differ in the last digits.
    gaps = gaps[gaps > 1e-9 * (levels[-1] - levels[0])]
    return float(np.percentile(gaps, 5.0)) if len(gaps) else 0.0


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
