"""Times that the motion contradicts: a command that acts before its stamps, a velocity that a filter delays."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import LATE, fault, late_option
from idloop.records.inspection.measured_input import all_near, decided
from idloop.records.inspection.response import Projection, plain_responses, regress
from idloop.records.inspection.time_axes import shifted_axes

COMMAND, VELOCITY = "late_command", "late_velocity"

# Least shift of a command [samples], what is left of the acceleration beside that with any command in time, and the
# share that the command must explain.
_LEAST, _LEFT, _SHARE = 4, 0.25, 0.8

# Samples that a velocity may be late: the difference of the last two positions is half a sample late.
_USUAL, _ERRORS = 1.5, 5.0
_WIDTHS, _FEWEST = (17, 33, 65, 129, 257, 513), 48


def late_command(axis: Axis) -> Finding | None:
    """A motion before its command, which no machine makes: the stamps of one are late, or those of the other early.

    The balance with a command that comes later than its stamps is compared with that of one that comes earlier.
    """
    least = (_LEAST - 0.5) * axis.period
    shown = [one for one in shifted_axes(axis) if one.share > _SHARE and -one.offset > least]
    part, early, share = min(
        (((1.0 - one.share) / (1.0 - one.causal), -one.offset, one.share) for one in shown), default=(1.0, 0.0, 0.0)
    )
    if part > _LEFT:
        return _a_sample_late(axis)
    name = axis.command_name
    return fault(
        COMMAND,
        name,
        f"the motion comes {1e3 * early:.3g} ms before {name}, which no machine makes: with the command so much"
        f" earlier, {100.0 * (1.0 - part):.0f} % less of the acceleration is left unexplained",
        f"subtract {early:.4g} s from the stamps of {name} ({late_option(early)}), or record both by one clock",
        evidence={LATE: early, "left": part, "share": share},
        spoils=("identification",),
    )


def _a_sample_late(axis: Axis) -> Finding | None:
    """Name a command that acts half a sample before its stamps, where one in time acts half a sample after them.

    By the position: the noise of a velocity, from which a command was computed, looks like one that acts early. A body
    behind a spring moves that instant: what acts within a few samples must be the command.
    """
    plain = plain_responses(axis)
    if not plain or min(plain, key=lambda one: one.functions.width).share < _SHARE:
        return None
    place = axis.name("position")
    shown = decided(axis.input_time, axis.command, axis.time, axis.motions)
    if place not in shown or not all_near(shown, -0.5):
        return None
    name, (late, error) = axis.command_name, shown[place]
    return fault(
        COMMAND,
        name,
        f"{name} acts {-late:.2g} ± {error:.1g} samples before its stamps by {place}, which no machine makes: it was"
        " recorded a sample late",
        f"subtract {axis.period:.4g} s from the stamps of {name} ({late_option(axis.period)}), or record what was sent"
        " before what was measured after it",
        evidence={LATE: axis.period, "late": late, "error": error},
        spoils=("delays",),
    )


def late_velocity(axis: Axis) -> Finding | None:
    """A velocity that a filter in the drive delays.

    In weak form a late velocity is ``v = s (w - delay a + ...)`` with the velocity ``w``, the acceleration ``a`` and
    the jerk of the recorded position. Over short test functions the noise of the position hides the delay; over long
    ones it is visible, and the longest with a certain delay counts.
    """
    grid = axis.grid
    if grid is None or not axis.trusts_velocity or axis.position is None or axis.velocity is None:
        return None
    late = error = np.nan
    for width in _WIDTHS:
        if grid.time.size < width + _FEWEST * (width // 4):
            break
        projection = Projection(width, grid.period)
        slope, acceleration, jerk = (projection.project(grid.position, order) for order in (1, 2, 3))
        velocity = projection.project(grid.velocity)
        table = np.column_stack([slope, -acceleration, jerk, np.ones(slope.size), velocity])
        table = table[np.isfinite(table).all(axis=1)]
        if len(table) < _FEWEST:
            continue
        values, errors, _ = regress(table[:, -1], table[:, :-1])
        if values[0] and values[1] / values[0] - _ERRORS * errors[1] / abs(values[0]) > _USUAL * axis.period:
            late, error = float(values[1] / values[0]), float(errors[1] / abs(values[0]))
    if np.isnan(late):
        return None
    name = axis.name("velocity")
    return fault(
        VELOCITY,
        name,
        f"{name} is {1e3 * late:.3g} ± {1e3 * error:.1g} ms behind the slope of {axis.name('position')}"
        f" ({late / axis.period:.2g} samples): the drive filters it",
        f"add `velocity_filter@velocity[{axis.joint}]` to the effects of the model file, or leave the velocity out",
        evidence={"delay": late, "error": error, "samples": late / axis.period},
    )
