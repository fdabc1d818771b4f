"""Single bad readings: samples far off the smooth course of their neighbours, or far outside of all others."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.spelling import counted

# More than this share are noise of another kind.
_MOST = 0.02
_UNEVEN = 0.5
_FURTHER = 4.0

_BLOCK = 32  # samples of a block whose median deviation is the scatter there
# A sample lies off by this many scatters, and off the courses before and after it alike.
_FAR, _ALIKE = 7.0, 0.5
# ... and by this many times the largest bend beside it: a start of a motion bends over several samples.
_BENDS, _BESIDE = 3.0, 4
_BOUNCE = 1.0  # the slopes on both sides differ by less than this share of it: where play closes, a mass is thrown back
_STEPS = 4.0  # off by so many steps of the signal: fewer are its rounding


def stray(axis: Axis) -> dict[str, Integers]:
    """Return the samples of position and velocity off the course of their neighbours, by ``joint.field``."""
    after = driven(axis)
    return {axis.name(signal): _near(axis, signal, value, after) for signal, value in axis.signals.items()}


def spikes(axis: Axis) -> list[Finding]:
    """Name the readings far outside of all others, and the samples off the course of their neighbours."""
    found, near = [], stray(axis)
    for signal, value in {**axis.signals, "command": axis.command}.items():
        name, unit = axis.name(signal), axis.unit(signal)
        time = axis.input_time if signal == "command" else axis.time
        # A command may jump as it likes.
        rows = near.get(f"{axis.joint}.{signal}", np.zeros(0, dtype=np.int64))
        when, off = time[rows], _distance(value, rows)
        if signal in axis.bad:
            far, values = axis.bad[signal]
            when, off = np.append(when, far), np.append(off, np.abs(values - np.nanmedian(value)))
        if not when.size:
            continue
        largest = int(np.argmax(off))
        found.append(
            fault(
                "spikes",
                name,
                f"{name}: {counted(when.size, 'value')} off the others, by up to {off[largest]:.3g} {unit} (at"
                f" {when[largest]:.4g} s): single bad readings",
                "look at the wiring of the sensor; fits leave them out",
                evidence={"spikes": when.size, "largest": off[largest]},
                places=around(time, np.searchsorted(time, np.sort(when))),
            )
        )
    return found


def _distance(value: Array, rows: Integers) -> Array:
    """How far samples lie off the middle of the measured ones beside them."""
    known = np.flatnonzero(np.isfinite(value))
    place = np.searchsorted(known, rows)
    beside = 0.5 * (value[known[place - 1]] + value[known[place + 1]]) if rows.size else np.zeros(0)
    return np.asarray(np.abs(value[rows] - beside))


def _near(axis: Axis, signal: str, value: Array, after: Integers) -> Integers:
    """Samples off the course of their neighbours."""
    known = np.flatnonzero(np.isfinite(value))
    time, values = axis.time[known], value[known]
    even = np.ones(values.size, dtype=bool)
    if values.size > 2:
        uneven = np.abs(np.diff(time) / axis.period - 1.0) > _UNEVEN
        even[1:] &= ~uneven
        even[:-1] &= ~uneven
    rows = isolated(values, axis.resolution[signal], even)
    before, here, next_ = values[rows - 1], values[rows], values[rows + 1]
    # A value that is repeated lies off as well, and so does the answer of a fast axis to a jump of its command. One
    # between those beside it was read late or early within the interval, and is true.
    odd = (
        (here != before) & (~np.isin(known[rows], after) | _far(values, rows)) & ((here - before) * (next_ - here) <= 0)
    )
    rows = rows[odd]
    if signal == "velocity" and axis.place is not None and axis.trusts_velocity:
        rows = rows[~_moved(axis.place[known], time, values, rows)]
    return np.asarray(known[rows if rows.size <= _MOST * values.size else rows[:0]])


def _far(value: Array, rows: Integers) -> Mask:
    """Whether samples lie further off than the signal moves in any sample around them."""
    beside = np.clip(rows[:, None] + np.array([-5, -4, -3, 2, 3, 4, 5]), 1, value.size - 1)
    largest = np.max(np.abs(value[beside] - value[beside - 1]), axis=1)
    return np.asarray(np.abs(value[rows] - 0.5 * (value[rows - 1] + value[rows + 1])) > _FURTHER * largest)


def _moved(place: Array, time: Array, velocity: Array, rows: Integers) -> Mask:
    """Whether the position moved as the velocity says, and not as its neighbours do."""
    step = time[rows + 1] - time[rows - 1]
    travel = place[rows + 1] - place[rows - 1]
    beside = 0.5 * (velocity[rows - 1] + velocity[rows + 1])
    with_it, without = 0.5 * (beside + velocity[rows]) * step, beside * step
    return np.asarray(np.abs(travel - with_it) < np.abs(travel - without))


def driven(axis: Axis) -> Integers:
    """Samples up to four after a jump of the command, where such jumps are rare: a fast axis answers within them."""
    if axis.command.size < 64:
        return np.zeros(0, dtype=np.int64)
    change = np.abs(np.diff(axis.command))
    jumps = np.flatnonzero(change > max(10.0 * float(np.median(change)), 0.05 * float(np.ptp(axis.command)))) + 1
    if jumps.size > 0.2 * axis.command.size:
        return np.zeros(0, dtype=np.int64)
    first = np.searchsorted(axis.time, axis.input_time[jumps])
    return np.unique(first[:, None] + np.arange(5))


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
