"""Zero-phase Butterworth low-pass, compiled.

SciPy's does the same; but importing scipy.signal takes a second, more than most of what waits for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The two pairs of poles of the fourth-order Butterworth prototype: s² + q s + 1.
_DAMPING = (2.0 * np.sin(np.pi / 8.0), 2.0 * np.sin(3.0 * np.pi / 8.0))


def zero_phase(values: Array, cutoff: float, sample_time: float, pad: int) -> Array:
    """Filter forwards and backwards along the first axis, by fourth order each time.

    Parameters
    ----------
    values : array, shape (n,) or (n, k)
    cutoff : float
        Frequency [Hz] at which one pass is down to 0.71; below half the sample rate.
    sample_time : float
        [s].
    pad : int
        Samples by which the signal goes on beyond its ends, mirrored at them in both directions; fewer than n.

    Returns
    -------
    array
        Of the shape of ``values``.
    """
    # Bilinear transform with the cut-off where it was asked for.
    warped = np.tan(np.pi * cutoff * sample_time)
    sections = np.empty((len(_DAMPING), 3))
    for row, damping in enumerate(_DAMPING):
        scale = 1.0 + damping * warped + warped**2
        sections[row] = warped**2 / scale, 2.0 * (warped**2 - 1.0) / scale, (1.0 - damping * warped + warped**2) / scale
    before, after = 2.0 * values[0] - values[pad:0:-1], 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    extended = np.concatenate([before, values, after])
    columns = extended.reshape(len(extended), -1)
    _run(sections, columns)
    _run(sections, columns[::-1])
    return np.ascontiguousarray(extended[pad : pad + len(values)])


@njit(cache=True, nogil=True)
def _run(sections: Any, columns: Any) -> None:
    """Filter each column in place, from the state that its first value would have kept up."""
    for column in range(columns.shape[1]):
        for row in range(sections.shape[0]):
            b, a1, a2 = sections[row]
            # Numerator b (1 + z⁻¹)², unit gain at rest; direct form II transposed.
            first = (1.0 - b) * columns[0, column]
            second = (b - a2) * columns[0, column]
            for k in range(columns.shape[0]):
                value = columns[k, column]
                filtered = b * value + first
                first = 2.0 * b * value - a1 * filtered + second
                second = b * value - a2 * filtered
                columns[k, column] = filtered
