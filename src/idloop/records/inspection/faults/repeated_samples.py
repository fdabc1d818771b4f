"""Values that are repeated with new stamps: the log is faster than the sensor, or a value was sent again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.repeats import FASTER_LOG, FEWEST, SHARE, repeats, without_repeats


def check(axis: Axis) -> list[Finding]:
    """Count equal values while the axis moves."""
    found = []
    for name, value in axis.columns.items():
        known = np.flatnonzero(np.isfinite(value))
        rows, moving = repeats(value[known])
        share = rows.size / max(moving, 1)
        if rows.size < FEWEST or share < SHARE:
            continue
        fresh = max(1.0 - share, SHARE)
        rate = 1.0 / axis.period
        if share > FASTER_LOG:
            why = (
                f"the log runs at {rate:.4g} Hz, the sensor at about {rate * fresh:.3g} Hz; the repeats count as not"
                " measured"
            )
            cure = "record at the rate of the sensor"
        else:
            why, cure = "the last value was sent again where none was read", "mark them as missing in the log"
        found.append(
            fault(
                "repeated_samples",
                name,
                f"{name} repeats {rows.size} of {moving} values in motion ({100 * share:.2g} %) with new stamps: {why}",
                cure,
                evidence={"share": share, "repeats": float(rows.size)},
                spoils=("delays",) if share > FASTER_LOG else (),
                count=int(rows.size),
                places=around(axis.time, known[rows + 1]),
            )
        )
    return found


def fresh(axis: Axis) -> Axis:
    """Return the axis with NaN where a log that is faster than its sensor repeats a value."""
    position, velocity = (None if one is None else without_repeats(one) for one in (axis.position, axis.velocity))
    return replace(axis, position=position, velocity=velocity)
