"""Values that no fit can use: missing ones, too large ones, bad readings, and a motion that a large offset hides."""

from __future__ import annotations

from typing import Literal

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.finding import Finding

# Larger values, and smaller motions than its inverse, are no measurement: their products leave the range of a double.
LARGEST = 1e50
_MANY_LOST = 0.01  # share of the readings of a measurement that are lost, from which on fits feel it
_COARSEST = 1e-4  # coarsest step of a double in a motion, as a share of it
# A bad reading is off the median of the samples around it by this many ranges of that median, which single values do
# not change. More than this share of the samples are no single ones.
_BEYOND, _AROUND, _MOST, _FEWEST = 4.0, 5, 0.01, 30


def runs(at: Mask) -> list[tuple[int, int]]:
    """Return first row, and row behind the last, of the runs in which a mask (n,) holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def bad_readings(value: Array) -> Integers:
    """Return the samples of a signal (n,) of which one or two at a time lie far beyond the range of all others.

    They hide the motion: an overflow, a lost bit, a frame read askew.
    """
    known = np.flatnonzero(np.isfinite(value))
    if known.size < _FEWEST:
        return known[:0]
    x = value[known]
    usual = float(np.diff(np.quantile(x, [_MOST, 1.0 - _MOST]))[0])
    with np.errstate(over="ignore"):
        if not np.ptp(x) > _BEYOND * usual:
            return known[:0]
        middle = np.median(np.lib.stride_tricks.sliding_window_view(x, _AROUND), axis=1)
        middle = np.pad(middle, _AROUND // 2, mode="edge")
        span = float(np.ptp(middle))
        rows = np.flatnonzero(np.abs(x - middle) > _BEYOND * span)
    # Beside a signal that never moves, a step of its sensor would be as far.
    return np.asarray(known[rows] if span > 0.0 and rows.size <= _MOST * x.size else known[:0])


def without_bad_readings(value: Array) -> Array:
    """Return a signal (n,) with NaN for its bad readings."""
    rows = bad_readings(value)
    if not rows.size:
        return value
    left: Array = value.copy()
    left[rows] = np.nan
    return left


def unusable_magnitude(signal: str, lowest: float, highest: float) -> str:
    """Return why a signal between two values cannot be computed with, and what to do; empty where it can."""
    largest, span = max(abs(lowest), abs(highest)), highest - lowest
    if largest > LARGEST:
        return f"{signal} reaches {largest:.3g}, no measurement is above {LARGEST:g}; check its unit and how it is read"
    if 0.0 < span < 1.0 / LARGEST:
        return f"{signal} varies by only {span:.3g}; check its unit and how it is read"
    step = float(np.spacing(largest))
    if step > _COARSEST * span > 0.0:
        return (
            f"{signal} is about {largest:.3g} and varies by {span:.3g}, but numbers of that size have steps of"
            f" {step:.2g}; subtract its offset where it is recorded or imported"
        )
    return ""


def missing_values(name: str, stamp_ns: Integers, value: Array, where: str, *, command: bool) -> list[Finding]:
    """Say how many values of one signal are missing, and where.

    `name`: signal, for the reader.
    `stamp_ns` (n,): times in the text count from the first of them.
    `value` (n,): in any unit; NaN where it is missing.
    `where`: topic or column.
    `command`: a command is held over its gaps, which may be wrong; a measurement is not, and only misses what is lost.
    Returns: one or none.
    """
    missing = np.isnan(value)
    lost, known = np.flatnonzero(missing), np.flatnonzero(~missing)
    if not lost.size:
        return []
    first, last = (float(stamp_ns[k] - stamp_ns[0]) * 1e-9 for k in (lost[0], lost[-1]))
    stretches = len(runs(missing))
    place = f"at {first:.6g} s" if lost.size == 1 else f"from {first:.6g} to {last:.6g} s"
    if stretches > 1:
        place = f"in {stretches} places {place}"
    text = f"{name}: {lost.size} of {value.size} values are missing (NaN), {place}"
    # Before its first value a command is unknown, not held.
    if command and lost[-1] >= lost.size:
        text += "; the command before is assumed to hold there: correct the log if the drive received another one"
    # Rows between those of a sensor may be of another one: where a reading is lost, the stamps have a hole as well.
    share = min(_lost_share(known), _lost_share(np.sort(stamp_ns[known])))
    if not command and share > _MANY_LOST:
        text += f": {100.0 * share:.2g} % of its readings are lost"
    level: Literal["note", "warning"] = "warning" if command or share > _MANY_LOST else "note"
    return [Finding("not_measured", text, int(lost.size), where, level)]


def _lost_share(places: Integers) -> float:
    """Share of the readings that are lost, by their rows or stamps; a sensor slower than the log loses none."""
    steps = np.diff(places)
    steps = steps[steps > 0]
    if steps.size < 2:
        return 0.0
    # Where every third is lost, half of the steps are longer.
    usual = float(np.percentile(steps, 25.0, method="lower"))
    lost = float(np.sum(np.maximum(np.round(steps / usual) - 1.0, 0.0)))
    return lost / (lost + places.size)
