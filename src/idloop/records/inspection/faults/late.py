"""Times that the motion contradicts: a command that acts before its stamps, a velocity that a filter delays."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import LATE, fault, late_option
from idloop.records.inspection.measured_input import all_near, decided
from idloop.records.inspection.response import Projection, Response, plain_responses, regress

COMMAND, VELOCITY = "late_command", "late_velocity"

# Shifts of the command that are tried first [samples], then each one between the neighbours of the best.
_SHIFTS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
# Least shift [samples], and the longest as a part of the record.
_LEAST, _LONGEST = 4, 0.05
# What is left of the acceleration beside that with any command in time, and the share that the command must explain.
_LEFT, _SHARE = 0.25, 0.8
_KNOWN = 0.5  # part of the rows that must be known with every shift

# Samples that a velocity may be late: the difference of the last two positions is half a sample late.
_USUAL, _ERRORS = 1.5, 5.0
_WIDTHS, _FEWEST = (17, 33, 65, 129, 257, 513), 48


def late_command(axis: Axis) -> Finding | None:
    """A motion before its command, which no machine makes: the stamps of one are late, or those of the other early.

    The balance with a command that comes later than its stamps is compared with that of one that comes earlier.
    """
    grid = axis.grid
    if grid is None:
        return None
    shifts = [_earlier(one, grid.command) for one in plain_responses(axis)]
    found = [one for one in shifts if one is not None]
    if not found:
        return _a_sample_late(axis)
    part, samples, share = min(found, key=lambda one: one[0])
    early, name = samples * grid.period, axis.command_name
    return fault(
        COMMAND,
        name,
        f"the motion comes {1e3 * early:.3g} ms before {name}, which no machine makes: with the command so much"
        f" earlier, {100.0 * (1.0 - part):.0f} % less of the acceleration is left unexplained",
        f"subtract {early:.4g} s from the stamps of {name} ({late_option(early)}), or record both by one clock",
        evidence={LATE: early, "left": part, "share": share},
        spoils=("identification",),
    )


def _earlier(one: Response, command: Array) -> tuple[float, int, float] | None:
    """What an earlier command leaves over what one in time does, samples that it is earlier, and share explained."""
    most = min(max(_SHIFTS), int(_LONGEST * command.size))
    tried = [shift for shift in _SHIFTS if shift <= most]
    rows = {shift: one.functions.project(_moved(command, shift)) for each in tried for shift in (each, -each)}
    # All shifts are compared on the same rows.
    known = one.known & np.isfinite(np.array(list(rows.values()))).all(axis=0)
    if np.count_nonzero(known) < _KNOWN * np.count_nonzero(one.known):
        return None
    others, _ = np.linalg.qr(one.others[known])
    target = _beside(one.acceleration[known], others)
    left = {shift: 1.0 - _share(target, _beside(row[known], others)) for shift, row in rows.items()}
    in_time = min(left[shift] for shift in tried)
    near = min(tried, key=lambda shift: left[-shift])
    if not left[-near] < in_time:
        return None
    below = max((shift for shift in tried if shift < near), default=0)
    above = min((shift for shift in tried if shift > near), default=most)
    for shift in range(below + 1, above):
        row = one.functions.project(_moved(command, -shift))[known]
        left[-shift] = 1.0 - _share(target, _beside(row, others)) if np.isfinite(row).all() else np.inf
    lead = -min(left, key=lambda shift: left[shift])
    part, share = left[-lead] / in_time, 1.0 - left[-lead]
    return (part, lead, share) if lead >= _LEAST and part < _LEFT and share > _SHARE else None


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


def _moved(command: Array, shift: int) -> Array:
    """The command so many samples later."""
    moved = np.full_like(command, np.nan)
    if shift >= 0:
        moved[shift:] = command[: command.size - shift]
    else:
        moved[:shift] = command[-shift:]
    return moved


def _beside(column: Array, others: Array) -> Array:
    """What orthonormal columns do not explain of another one."""
    return np.asarray(column - others @ (others.T @ column))


def _share(target: Array, command: Array) -> float:
    """Share of the power of the target that the command explains."""
    power = float(target @ target) * float(command @ command)
    return float(target @ command) ** 2 / power if power > 0.0 else 0.0


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
