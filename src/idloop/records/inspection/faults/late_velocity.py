"""A velocity that a filter in the drive delays.

In weak form a late velocity is ``v = s (w - delay a + ...)`` with the velocity ``w``, the acceleration ``a`` and the
jerk of the recorded position. Over short test functions the noise of the position hides the delay; over long ones it
is visible, and the longest with a certain delay counts.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import Projection, regress

KIND = "late_velocity"

# Samples that a velocity may be late: the difference of the last two positions is half a sample late.
_LATE = 1.5
_ERRORS = 5.0
_WIDTHS = (17, 33, 65, 129, 257, 513)
_FEWEST = 48


def check(axis: Axis) -> list[Finding]:
    """Estimate the delay between the slope of the position and the velocity."""
    grid = axis.grid
    if grid is None or not axis.trusts_velocity or axis.position is None or axis.velocity is None:
        return []
    best: tuple[float, float] | None = None
    for width in _WIDTHS:
        if grid.time.size < width + _FEWEST * (width // 4):
            break
        projection = Projection(width, grid.period)
        table = np.column_stack(
            [
                projection.project(grid.position, 1),
                -projection.project(grid.position, 2),
                projection.project(grid.position, 3),
                projection.project(grid.velocity),
            ]
        )
        table = table[np.isfinite(table).all(axis=1)]
        if len(table) < _FEWEST:
            continue
        ones = np.ones((len(table), 1))
        values, errors, _ = regress(table[:, 3], np.hstack([table[:, :3], ones]))
        if values[0] == 0.0:
            continue
        late, error = values[1] / values[0], errors[1] / abs(values[0])
        if late - _ERRORS * error > _LATE * axis.period:
            best = (float(late), float(error))
    if best is None:
        return []
    late, error = best
    name = axis.name("velocity")
    return [
        fault(
            KIND,
            name,
            f"{name} is {1e3 * late:.3g} ± {1e3 * error:.1g} ms behind the slope of {axis.name('position')}"
            f" ({late / axis.period:.2g} samples): the drive filters it",
            f"add `velocity_filter@velocity[{axis.joint}]` to the effects of the model file, or leave the velocity out",
            evidence={"delay": late, "error": error, "samples": late / axis.period},
        )
    ]
