"""Single bad readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis, Floats
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.faults.local import isolated

# More than this share are noise of another kind.
_MOST = 0.02
_UNEVEN = 0.5
_FURTHER = 4.0


def check(axis: Axis) -> list[Finding]:
    """Look for samples off the course of their neighbours on both sides."""
    found = []
    after = driven(axis)
    for signal, value in (("position", axis.place), ("velocity", axis.velocity)):
        if value is None:
            continue
        known = np.flatnonzero(np.isfinite(value))
        time, values = axis.time[known], value[known]
        even = np.ones(values.size, dtype=bool)
        if values.size > 2:
            uneven = np.abs(np.diff(time) / axis.period - 1.0) > _UNEVEN
            even[1:] &= ~uneven
            even[:-1] &= ~uneven
        rows = isolated(values, axis.resolution[signal], even)
        # A value that is repeated lies off as well, and so does the answer of a fast axis to a jump of its command.
        rows = rows[(values[rows] != values[rows - 1]) & (~np.isin(known[rows], after) | _far(values, rows))]
        if signal == "velocity" and axis.place is not None and axis.trusts_velocity:
            rows = rows[~_moved(axis.place[known], time, values, rows)]
        if not rows.size or rows.size > _MOST * values.size:
            continue
        off = np.abs(values[rows] - 0.5 * (values[rows - 1] + values[rows + 1]))
        name, unit = axis.name(signal), axis.unit(signal)
        largest = int(np.argmax(off))
        many = "1 value" if rows.size == 1 else f"{rows.size} values"
        found.append(
            fault(
                "spikes",
                name,
                f"{name}: {many} off the neighbours, by up to {off[largest]:.3g} {unit} (at"
                f" {time[rows[largest]]:.4g} s): single bad readings",
                "mark them as missing in the log (an empty cell), and look at the wiring of the sensor",
                evidence={"spikes": float(rows.size), "largest": float(off[largest])},
                count=int(rows.size),
                places=around(time, rows),
            )
        )
    return found


def _far(value: Floats, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether samples lie further off than the signal moves in any sample around them."""
    beside = rows[:, None] + np.array([-5, -4, -3, 2, 3, 4, 5])
    beside = np.clip(beside, 1, value.size - 1)
    largest = np.max(np.abs(value[beside] - value[beside - 1]), axis=1)
    return np.asarray(np.abs(value[rows] - 0.5 * (value[rows - 1] + value[rows + 1])) > _FURTHER * largest)


def _moved(place: Floats, time: Floats, velocity: Floats, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the position moved as the velocity says, and not as its neighbours do."""
    step = time[rows + 1] - time[rows - 1]
    travel = place[rows + 1] - place[rows - 1]
    beside = 0.5 * (velocity[rows - 1] + velocity[rows + 1])
    with_it, without = 0.5 * (beside + velocity[rows]) * step, beside * step
    return np.asarray(np.abs(travel - with_it) < np.abs(travel - without))


def driven(axis: Axis) -> NDArray[np.int64]:
    """Samples up to four after a jump of the command, where such jumps are rare: a fast axis answers within them."""
    if axis.command.size < 64:
        return np.zeros(0, dtype=np.int64)
    change = np.abs(np.diff(axis.command))
    jumps = np.flatnonzero(change > max(10.0 * float(np.median(change)), 0.05 * float(np.ptp(axis.command)))) + 1
    if jumps.size > 0.2 * axis.command.size:
        return np.zeros(0, dtype=np.int64)
    first = np.searchsorted(axis.time, axis.input_time[jumps])
    return np.unique(first[:, None] + np.arange(5))
