"""A loop that was closed without its reference on record: the command answers to the newest motion.

What is new in a measurement, its noise and its steps, was not known to any command before. Where it shows in the next
command, the command was computed from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

Floats = NDArray[np.float64]

# Past commands, older measurements, and newest measurements of the regression; samples used.
_PAST, _OLD, _NEW, _MOST, _FEWEST = 8, 6, 4, 20_000, 300
# Share of what is new in the command that the newest measurements explain, without the largest errors: those are steps
# of a reference.
_SHARE, _STEPS = 0.3, 0.1
_SAME_RATE = 0.1


def check(axis: Axis) -> list[Finding]:
    """Predict the command with and without the newest measurements."""
    if axis.has_reference or axis.command.size < _FEWEST or axis.time.size < _FEWEST:
        return []
    if abs(float(np.median(np.diff(axis.input_time))) / axis.period - 1.0) > _SAME_RATE:
        return []
    best = 0.0
    for signal, value in (("position", axis.place), ("velocity", axis.velocity)):
        if value is not None and (share := _explained(axis, value)) > best:
            best, which = share, signal
    if best < _SHARE:
        return []
    name, source = axis.command_name, axis.name(which)
    return [
        fault(
            "unrecorded_reference",
            name,
            f"{name} answers to the newest {source} ({100 * best:.0f} % of what is new in it): a loop was closed, and"
            " its reference is not on record",
            "record the reference (topic `reference`, `reference:` in the mapping), and judge a model by the command",
            evidence={"share": best},
            spoils=("open-loop black-box models",),
        )
    ]


def _explained(axis: Axis, value: Floats) -> float:
    """Share of the newest command, beyond its past, that the newest measurements explain."""
    after = np.searchsorted(axis.input_time, axis.time - 1e-3 * axis.period)
    good = (after < axis.command.size) & np.isfinite(value)
    command = axis.command[np.minimum(after, axis.command.size - 1)]
    good &= np.isfinite(command)
    value, command = value[good], command[good]
    if value.size < _FEWEST:
        return 0.0
    value, command = value[-_MOST:], command[-_MOST:]
    if np.ptp(command) == 0.0 or np.ptp(value) == 0.0:
        return 0.0
    # Differences: no offset, no drift, and no large common part.
    value, command = np.diff(value), np.diff(command)
    last = _OLD + _NEW
    rows = np.arange(max(_PAST, last), command.size)
    # Where the command is held over many samples, only its changes may answer to anything.
    target = command[rows]
    if np.mean(target != 0.0) < 0.2:
        return 0.0
    past = [command[rows - k] for k in range(1, _PAST + 1)]
    old = [value[rows - k] for k in range(_NEW, last)]
    new = [value[rows - k] for k in range(_NEW)]
    known = np.column_stack([*past, *old])
    keep = np.ones(rows.size, dtype=bool)
    for _ in range(2):
        left = np.abs(_left(known, target, keep))
        with_new = np.abs(_left(np.column_stack([known, *new]), target, keep))
        keep = with_new <= np.quantile(with_new, 1.0 - _STEPS)
    power = float(np.mean(left[keep] ** 2))
    floor = (1e-9 * float(np.std(target))) ** 2
    return 1.0 - float(np.mean(with_new[keep] ** 2)) / power if power > floor else 0.0


def _left(table: Floats, target: Floats, keep: NDArray[np.bool_]) -> Floats:
    size = np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    weights = np.linalg.lstsq(table[keep] / size, target[keep], rcond=1e-12)[0]
    return np.asarray(target - (table / size) @ weights)
