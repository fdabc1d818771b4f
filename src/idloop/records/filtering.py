"""Zero-phase filters for signals with stamps: gaps and jitter allowed, NaN means not measured."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError

_ON_GRID = 0.01  # stamps within 1 % of the period count as a grid and are filtered in place


def zero_phase(time: Array, value: Array, low: float | None, high: float | None, order: int = 4) -> Array:
    """Filter forwards and backwards with a Butterworth filter, so that nothing is delayed.

    `time` (n,): stamps [s], increasing.
    `value` (n,): samples; NaN (not measured) stays NaN and takes no part.
    `low`, `high`: edges of the pass band [Hz]; None leaves that side open.
    `order`: order of one pass; the magnitude response is applied twice.
    Returns shape (n,).
    Raises InputError: band empty or above half the sample rate, or too few samples.
    """
    from scipy.signal import butter, sosfiltfilt

    known = np.flatnonzero(np.isfinite(value))
    result = np.full_like(value, np.nan)
    if known.size == 0:
        return result
    if known.size < 3 * (2 * order + 1):
        raise InputError(
            f"{known.size} samples are too few for a filter of order {order}; take a lower order or a longer record"
        )
    t, x = time[known], value[known]
    period = float(np.median(np.diff(t)))
    edges, kind = _band(low, high, 0.5 / period)
    sections = butter(order, edges, kind, fs=1.0 / period, output="sos")
    if float(np.abs(np.diff(t) - period).max()) <= _ON_GRID * period:
        result[known] = sosfiltfilt(sections, x)
        return result
    grid = np.arange(t[0], t[-1] + 0.5 * period, period)
    smooth = sosfiltfilt(sections, np.interp(grid, t, x))
    result[known] = np.interp(t, grid, smooth)
    return result


def _band(low: float | None, high: float | None, nyquist: float) -> tuple[float | list[float], str]:
    for name, edge in (("low", low), ("high", high)):
        if edge is not None and not 0 < edge < nyquist:
            raise InputError(
                f"filter edge {name} = {edge:g} Hz; it must lie between 0 and half the sample rate, {nyquist:.6g} Hz"
            )
    if low is not None and high is not None:
        if low >= high:
            raise InputError(f"filter band {low:g} to {high:g} Hz is empty; give low < high")
        return [low, high], "bandpass"
    if high is not None:
        return high, "lowpass"
    if low is not None:
        return low, "highpass"
    raise InputError("a filter needs an edge; give low, high or both in Hz")


def resample_held(time: Array, value: Array, at: Array) -> Array:
    """Return the value that is held at each instant: the last one stamped at or before it, NaN before the first."""
    index = np.searchsorted(time, at, side="right") - 1
    held: Array = np.where(index >= 0, value[np.maximum(index, 0)], np.nan)
    return held


def held_mean(time: Array, value: Array, edges: Array) -> Array:
    """Return the mean of a held signal between edges (n + 1,) -> (n,); before its stamps the first value holds."""
    area = np.concatenate([[0.0], np.cumsum(value[:-1] * np.diff(time))])
    index = np.maximum(np.searchsorted(time, edges, side="right") - 1, 0)
    total = area[index] + value[index] * (edges - time[index])
    return np.asarray(np.diff(total) / np.diff(edges))


def resample_linear(time: Array, value: Array, at: Array, longest: float) -> Array:
    """Interpolate linearly between measured samples; NaN outside them and inside gaps longer than `longest` [s]."""
    known = np.isfinite(value)
    t, x = time[known], value[known]
    if t.size == 0:
        return np.full(at.shape, np.nan)
    result = np.interp(at, t, x, left=np.nan, right=np.nan)
    if t.size > 1:
        right = np.clip(np.searchsorted(t, at, side="left"), 1, t.size - 1)
        gap = (t[right] - t[right - 1] > longest) & (at > t[right - 1]) & (at < t[right])
        result[gap] = np.nan
    return result
