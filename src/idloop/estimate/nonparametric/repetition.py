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
    if found is None:
        return (here, None) if here > _UNLIKE else None
    fits = period % found == 0 or here <= _MISSED or float(miss[found]) > _BETTER * here
    return None if fits else (here, found)
