"""After how many samples a signal repeats: whether a period that is claimed is one, and which is where it is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DIFFERENT = 0.25  # mismatch that a signal must have gone through before it can have come back
_BACK = 0.2  # mismatch at which it has
_NEAR, _ALIKE = 1.3, 1e-4  # times the least mismatch, and more than that, one that is as good
_MISSED = 1e-3  # mismatch that a period may have beside one that fits better
_BETTER = 0.5  # of a period's mismatch, that of one that fits better
_UNLIKE = 0.5  # mismatch of a signal that does not repeat at all
_BESIDE, _LEAST_BESIDE = 100, 2  # neighbours of a period that are looked at: its hundredth part, and at least so many
_CLOSER = 0.7  # of a period's mismatch, that of a neighbour which is the period: noise makes less of a difference


def mismatches(signal: Array) -> Array:
    """Power of what a shift by each lag changes, over twice the signal's own, shape (n // 2 + 1,).

    0 where the signal repeats, 1 on the average of what has nothing in common with itself.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    centred = signal - np.mean(signal)
    count = len(centred)
    half = count // 2
    size = next_fast_len(2 * count, real=True)
    spectrum = rfft(centred, size)
    product = irfft(np.abs(spectrum) ** 2, size)[: half + 1]
    power = np.concatenate([[0.0], np.cumsum(centred**2)])
    lag = np.arange(half + 1)
    both = power[count - lag] + power[count] - power[lag]
    return np.asarray(np.clip(1.0 - 2.0 * product / np.maximum(both, 1e-300), 0.0, None))


def repetition(signal: Array) -> int | None:
    """Samples after which a signal repeats for the first time; None where it does not within half its length."""
    miss = mismatches(signal)
    away = np.flatnonzero(miss > _DIFFERENT)
    if away.size == 0:
        return None
    later = np.arange(len(miss)) >= away[0]
    least = float(np.min(miss[later]))
    if least > _BACK:
        return None
    return int(np.flatnonzero(later & (miss <= _NEAR * least + _ALIKE))[0])


def misfit(signal: Array, period: int) -> tuple[float, int | None] | None:
    """Mismatch of a claimed period and the one that fits; None where the claim is not worse than any other.

    A multiple of the period is a period.
    """
    miss = mismatches(signal)
    if period >= len(miss):
        return None
    here, found = float(miss[period]), repetition(signal)
    if here <= _MISSED or (found is not None and period % found == 0):
        return None
    # Noise hides what one sample changes in one period; over several periods the samples add up.
    closer = _closest(miss, period)
    if found is not None and float(miss[found]) <= _BETTER * here:
        as_good = closer != period and float(miss[closer]) <= _NEAR * float(miss[found]) + _ALIKE
        return here, closer if as_good else found
    if closer != period:
        return here, closer
    return (here, None) if found is None and here > _UNLIKE else None


def _closest(miss: Array, period: int) -> int:
    """The neighbour of a claimed period whose multiples fit clearly better, else the period."""
    width = min(max(period // _BESIDE, _LEAST_BESIDE), period - 1)
    near = np.arange(period - width, period + width + 1)
    times = np.arange(1, max((len(miss) - 1) // near[-1], 1) + 1)
    lags = np.minimum(near[:, None] * times, len(miss) - 1)
    mismatch = np.mean(miss[lags], axis=1)
    best = int(np.argmin(mismatch))
    return int(near[best]) if mismatch[best] < _CLOSER * mismatch[width] else period
