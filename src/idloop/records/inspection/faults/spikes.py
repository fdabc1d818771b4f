"""Single bad readings: samples far off a smooth course, or far outside of all others."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.faults.local import isolated

# More than this share are noise of another kind.
_MOST = 0.02
_UNEVEN = 0.5
_FURTHER = 4.0


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
        many = "1 value" if when.size == 1 else f"{when.size} values"
        found.append(
            fault(
                "spikes",
                name,
                f"{name}: {many} off the others, by up to {off[largest]:.3g} {unit} (at {when[largest]:.4g} s): single"
                " bad readings",
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
