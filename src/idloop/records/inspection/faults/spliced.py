"""Two recordings joined without a gap, samples lost from it, or a position set to another value while recording.

The position jumps once or twice, by far more than it moves between any other two samples, and goes on from there: no
axis with inertia does.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.faults.local import isolated
from idloop.records.inspection.motion import white_noise

KIND = "spliced"

# Times the largest of all other steps; most jumps, as more are another fault; longest interval, in the usual one.
_LARGER, _MOST, _UNEVEN = 5.0, 2, 1.2
# Before or after it the axis moves over so many samples by so many times its noise and its step: a log that is slow
# beside the motion holds a whole move between two samples at rest.
_BESIDE, _MOVES = 8, 5.0


def check(axis: Axis) -> list[Finding]:
    """Look for one or two jumps of a moving position that stay; along the motion they may be samples that were lost."""
    if axis.place is None or axis.wraps is not None:
        return []
    known = np.isfinite(axis.place)
    time, place = axis.time[known], axis.place[known]
    if time.size < 200:
        return []
    step, resolution = np.diff(place), axis.resolution["position"]
    rows = isolated(step, resolution, np.diff(time) < _UNEVEN * axis.period)
    rows = rows[(rows >= _BESIDE) & (rows < step.size - _BESIDE)]
    if not 1 <= rows.size <= _MOST:
        return []
    least = _MOVES * max(white_noise(place), resolution)
    before, after = place[rows] - place[rows - _BESIDE], place[rows + 1 + _BESIDE] - place[rows + 1]
    usual = float(np.abs(np.delete(step, rows)).max())
    if not ((np.abs(step[rows]) > _LARGER * usual) & (np.maximum(np.abs(before), np.abs(after)) > least)).all():
        return []
    name, unit = axis.name("position"), axis.unit("position")
    sizes = " and ".join(f"{step[row]:.3g} {unit} at {time[row + 1]:.4g} s" for row in rows)
    return [
        fault(
            KIND,
            name,
            f"{name} jumps by {sizes} between two samples, otherwise by {usual:.2g} {unit} at most, and goes on from"
            f" there: {_causes(step[rows], before, after)}",
            "cut them apart with `rows:` in the mapping",
            evidence={"jump": float(np.abs(step[rows]).max()), "usual": usual},
            spoils=("identification",),
            count=int(rows.size),
            places=around(time, rows + 1),
        )
    ]


def _causes(jumps: Array, before: Array, after: Array) -> str:
    """What may be behind the jumps, the most probable first, from the motion before and after each."""
    if not ((jumps * before > 0.0) & (jumps * after > 0.0)).all():
        return "two recordings were joined, samples were lost, or its zero was set"
    # One interval there is between any two samples.
    counts = [f"{count - 1.0:.0f}" for count in jumps / (0.5 * (before + after) / _BESIDE)]
    number = f"about {' and '.join(counts)} at the speed there"
    return f"samples were lost ({number}), two recordings were joined, or its zero was set"
