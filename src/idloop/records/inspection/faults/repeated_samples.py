"""Values that are repeated with new stamps: the log is faster than the sensor, or a value was sent again.

An axis under way passes several steps of its sensor in a sample, so that equal values are as rare as any other step. A
sensor that was not read gives equal values far more often than values one step apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault

Floats = NDArray[np.float64]

# Samples on each side that give the speed, the steps of the sensor that pass in a sample, and repeats that count.
_BESIDE, _STEPS = 8, 4.0
_FEWEST, _SHARE, _OFTENER = 5, 0.01, 5.0


def check(axis: Axis) -> list[Finding]:
    """Count equal values while the axis moves."""
    found = []
    for name, value in axis.columns.items():
        known = np.flatnonzero(np.isfinite(value))
        rows, moving = _repeats(value[known])
        share = rows.size / max(moving, 1)
        if rows.size < _FEWEST or share < _SHARE:
            continue
        fresh = 1.0 - share
        rate = 1.0 / axis.period
        if share > 0.3:
            why = f"the log runs at {rate:.4g} Hz, the sensor at about {rate * fresh:.3g} Hz"
            cure = f"record at the rate of the sensor, or keep every {round(1 / fresh)}. sample (`Record.decimate`)"
        else:
            why, cure = "the last value was sent again where none was read", "mark them as missing in the log"
        found.append(
            fault(
                "repeated_samples",
                name,
                f"{name} repeats {rows.size} of {moving} values in motion ({100 * share:.2g} %) with new stamps: {why}",
                cure,
                evidence={"share": share, "repeats": float(rows.size)},
                spoils=("delays", "sensor noise") if share > 0.3 else (),
                count=int(rows.size),
                places=around(axis.time, known[rows + 1]),
            )
        )
    return found


def _repeats(value: Floats) -> tuple[NDArray[np.int64], int]:
    """Return the intervals without a change while there is motion, and the number of intervals in motion."""
    nothing = np.zeros(0, dtype=np.int64)
    if value.size < 8 * _BESIDE:
        return nothing, 0
    step = np.diff(value)
    changes = np.abs(step[step != 0.0])
    if not changes.size:
        return nothing, 0
    resolution = float(np.percentile(changes, 1.0)) if np.unique(changes).size > 0.2 * changes.size else changes.min()
    mean = np.full(step.size, 0.0)
    mean[_BESIDE:-_BESIDE] = np.abs(value[2 * _BESIDE + 1 :] - value[: -2 * _BESIDE - 1])[: step.size - 2 * _BESIDE]
    # Under way on both sides: a standstill beside a motion is no repeat.
    early, late = np.zeros(step.size), np.zeros(step.size)
    early[_BESIDE:] = np.abs(value[_BESIDE:-1] - value[: -_BESIDE - 1])
    late[:-_BESIDE] = np.abs(value[_BESIDE + 1 :] - value[1:-_BESIDE])
    least = _STEPS * _BESIDE * resolution
    moving = (
        (mean > 2.0 * least)
        & (early > least)
        & (late > least)
        & (np.minimum(early, late) > 0.3 * np.maximum(early, late))
    )
    rows = np.flatnonzero(moving & (step == 0.0))
    # On steps of the sensor, noise alone makes as many small changes as none.
    small = np.count_nonzero(moving & (step != 0.0) & (np.abs(step) < 1.5 * resolution))
    return (rows if rows.size > _OFTENER * 0.5 * small else nothing), int(moving.sum())
