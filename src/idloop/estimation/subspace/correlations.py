"""Second moments of all windows from the correlations of the signals: one pass, a few operations a sample."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCK = 4096  # samples summed before they join the whole: short sums keep their digits


@njit(cache=True, fastmath={"contract", "reassoc"})
def _lagged(flat: Array, wide: int, reach: int, count: int, total: Array) -> None:
    """Add the products of the first `count` samples with the windows that begin at them, four at a time."""
    t = 0
    while t + 4 <= count:
        base = flat[t * wide : t * wide + reach + 3 * wide]
        for i in range(wide):
            row = total[i]
            s0, s1, s2, s3 = base[i], base[wide + i], base[2 * wide + i], base[3 * wide + i]
            for j in range(reach):
                row[j] += s0 * base[j] + s1 * base[wide + j] + s2 * base[2 * wide + j] + s3 * base[3 * wide + j]
        t += 4
    while t < count:
        for i in range(wide):
            for j in range(reach):
                total[i, j] += flat[t * wide + i] * flat[t * wide + j]
        t += 1


def window_moments(inputs: Array, outputs: Array, length: int) -> Array:
    """Sum of the outer products of all windows of two sets of signals.

    The block Hankel matrix repeats each sample `length` times, and so do the products of its rows: those of lag i with
    lag j and those of the two next lags differ by the first and the last sample alone. The first block of rows is
    therefore all that has to be summed (as SLICOT's IB01MD does; Sima, Sima and Van Huffel, J. Comput. Appl. Math. 170,
    2004).

    `inputs`, `outputs` (samples, m), (samples, p); `length`: samples in a window, at most `samples`. Returns shape
    (length (m + p), length (m + p)): a row is one signal at one lag, (u, y) of one lag and then of the next.
    """
    samples, wide = len(outputs), inputs.shape[1] + outputs.shape[1]
    windows, rows = samples - length + 1, length * wide

    def joint(first: int, last: int) -> Array:
        return np.hstack([inputs[first:last], outputs[first:last]]).ravel()

    whole = np.zeros((rows, rows))
    for start in range(0, windows, _BLOCK):
        count = min(_BLOCK, windows - start)
        part = np.zeros((wide, rows))
        _lagged(joint(start, start + count + length - 1), wide, rows, count, part)
        whole[:wide] += part
    whole[:, :wide] = whole[:wide].T
    # What leaves and what enters as both windows move on by one sample, all lags at once.
    leaves, enters = joint(0, length - 1), joint(windows, samples)
    for lag in range(1, length):
        row, before = slice(lag * wide, (lag + 1) * wide), slice((lag - 1) * wide, lag * wide)
        change = np.outer(enters[before], enters) - np.outer(leaves[before], leaves)
        whole[row, wide:] = whole[before, :-wide] + change
    return whole


def triangular(moments: Array, ridge: float = 0.0) -> Array | None:
    """Lower triangular square root, or none where the moments are too nearly singular to have one, shape (r, r).

    `moments` (r, r); `ridge`: variance that is added to each row, as a share of its own.
    """
    size = np.sqrt(np.diagonal(moments))
    if not np.all(size > 0.0):
        return None
    scaled = moments / np.outer(size, size)
    scaled[np.diag_indices_from(scaled)] += ridge
    try:
        return np.asarray(np.linalg.cholesky(scaled) * size[:, None])
    except np.linalg.LinAlgError:
        return None


def news(factor: Array) -> Array:
    """Deviation of each row that the rows above it do not explain, as a share of its own."""
    return np.asarray(np.abs(np.diagonal(factor)) / np.linalg.norm(factor, axis=1))
