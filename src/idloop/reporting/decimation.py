"""Fewer points without losing a peak: the lowest and the highest sample of every bucket of time."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array


def extremes(time: Array, values: Array, width: float) -> tuple[Array, Array]:
    """Keep two samples of each bucket and column: its lowest and its highest, in the order in which they came.

    The buckets lie on whole multiples of `width`, so that a window that moves on shows the same points again.

    `time` (n,): not decreasing [s]. `values` (n, k): NaN where there is none; a bucket without any stays NaN. `width`:
    length of a bucket [s]. Returns: first and last instant of every bucket that holds samples, and its values; the
    samples themselves where buckets would not make them fewer.
    """
    n = len(time)
    if n == 0 or width <= 0.0:
        return time, values
    starts = np.concatenate([[0], 1 + np.flatnonzero(np.diff(np.floor(time / width)))])
    if n <= 2 * len(starts):
        return time, values
    ends = np.append(starts[1:], n)
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    position = np.arange(n)[:, None]
    counts = ends - starts
    first_low = np.minimum.reduceat(np.where(values == np.repeat(low, counts, axis=0), position, n), starts)
    first_high = np.minimum.reduceat(np.where(values == np.repeat(high, counts, axis=0), position, n), starts)
    rising = first_low <= first_high
    few = np.empty((2 * len(starts), values.shape[1]))
    few[0::2] = np.where(rising, low, high)
    few[1::2] = np.where(rising, high, low)
    instants = np.empty(2 * len(starts))
    instants[0::2], instants[1::2] = time[starts], time[ends - 1]
    return instants, few
