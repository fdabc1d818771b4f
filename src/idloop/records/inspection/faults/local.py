"""Samples that lie far off a smooth course, judged by their neighbours."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers, Mask

# Samples of a block whose median deviation is the scatter there.
_BLOCK = 32
# A sample lies off by this many scatters, and off the courses before and after it alike.
_FAR, _ALIKE = 7.0, 0.5
# ... and by this many times the largest bend beside it: a start of a motion bends over several samples.
_BENDS, _BESIDE = 3.0, 4
# The slopes on both sides differ by less than this share of it: where play closes, a mass is thrown back.
_BOUNCE = 1.0
# Off by so many steps of the signal: fewer are its rounding.
_STEPS = 4.0


def isolated(value: Array, resolution: float, usual: Mask) -> Integers:
    """Return the samples that lie off the straight courses of their neighbours on both sides.

    A jump or a kink of a signal lies on the course of one side, a single wrong value on that of none, and both courses
    meet where it should be.

    `value` (n,): evenly sampled.
    `resolution`: smallest step of the signal.
    `usual` (n,): samples that may be judged.
    """
    if value.size < 2 * _BLOCK:
        return np.zeros(0, dtype=np.int64)
    left, right, kink = (np.full(value.size, np.nan) for _ in range(3))
    left[2:] = 2.0 * value[1:-1] - value[:-2]
    right[:-2] = 2.0 * value[1:-1] - value[2:]
    kink[2:-2] = np.abs((value[4:] - value[3:-1]) - (value[1:-3] - value[:-4]))
    off_left, off_right = value - left, value - right
    off = np.minimum(np.abs(off_left), np.abs(off_right))
    with np.errstate(invalid="ignore"):
        far = (off > _FAR * _scatter(off_left)) & (off > _STEPS * resolution)
        far &= (off > _BENDS * _bends(value)) & (kink < _BOUNCE * off)
        far &= (np.abs(left - right) < _ALIKE * off) & (off_left * off_right > 0.0)
    return np.flatnonzero(far & usual)


def _bends(value: Array) -> Array:
    """Largest second difference of the samples beside each one that does not contain it, shape (n,)."""
    bend = np.zeros(value.size)
    bend[1:-1] = np.abs(np.diff(value, 2))
    padded = np.pad(np.nan_to_num(bend), _BESIDE + 1)
    largest = np.lib.stride_tricks.sliding_window_view(padded, _BESIDE).max(axis=1)
    # A window starts so many samples before the one it is for, or two after it.
    return np.asarray(np.maximum(largest[: value.size], largest[_BESIDE + 3 : _BESIDE + 3 + value.size]))


def _scatter(value: Array) -> Array:
    """Standard deviation of most of a signal (n,) around each sample, by medians of blocks; the largest of three."""
    count = -(-value.size // _BLOCK)
    padded = np.full(count * _BLOCK, np.nan)
    padded[: value.size] = np.abs(value)
    blocks = np.sort(padded.reshape(count, _BLOCK), axis=1)  # NaN come last
    known = np.isfinite(blocks).sum(axis=1)
    middle = np.nan_to_num(blocks[np.arange(count), np.maximum(known - 1, 0) // 2])
    wide = np.maximum(middle, np.maximum(np.append(middle[1:], 0.0), np.insert(middle[:-1], 0, 0.0)))
    return np.asarray(1.4826 * np.repeat(wide, _BLOCK)[: value.size])
