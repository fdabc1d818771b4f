"""A motion before its command, which no machine makes: stamps of the command are late, or those of the motion early."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import LATE, fault, late_option
from idloop.records.inspection.measured_input import all_near, decided
from idloop.records.inspection.response import PLAIN, responses

KIND = "late_command"

# Shifts of the command that are tried first [samples], then each one between the neighbours of the best.
_SHIFTS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
# Least shift [samples], and the longest as a part of the record.
_LEAST, _LONGEST = 4, 0.05
# What is left of the acceleration beside that with any command in time, and the share that the command must explain.
_LEFT, _SHARE = 0.25, 0.8
# Part of the rows that must be known with every shift.
_KNOWN = 0.5


def check(axis: Axis) -> list[Finding]:
    """Compare the balance with a command that comes later than its stamps with that of one that comes earlier."""
    grid = axis.grid
    if grid is None:
        return []
    most = min(max(_SHIFTS), int(_LONGEST * grid.time.size))
    best: tuple[float, int, float] | None = None
    for found in (one for one in responses(axis) if one.functions.power == PLAIN):
        tried = [shift for shift in _SHIFTS if shift <= most]
        rows = {shift: found.functions.project(_moved(grid.command, shift)) for one in tried for shift in (one, -one)}
        # All shifts are compared on the same rows.
        known = found.known & np.isfinite(np.array(list(rows.values()))).all(axis=0)
        if np.count_nonzero(known) < _KNOWN * np.count_nonzero(found.known):
            continue
        others, _ = np.linalg.qr(found.others[known])
        target = _beside(found.acceleration[known], others)
        left = {shift: 1.0 - _share(target, _beside(row[known], others)) for shift, row in rows.items()}
        in_time = min(left[shift] for shift in tried)
        near = min(tried, key=lambda shift: left[-shift])
        if not left[-near] < in_time:
            continue
        below = max((shift for shift in tried if shift < near), default=0)
        above = min((shift for shift in tried if shift > near), default=most)
        for shift in range(below + 1, above):
            row = found.functions.project(_moved(grid.command, -shift))[known]
            left[-shift] = 1.0 - _share(target, _beside(row, others)) if np.isfinite(row).all() else np.inf
        lead = -min(left, key=lambda shift: left[shift])
        part, share = left[-lead] / in_time, 1.0 - left[-lead]
        if lead < _LEAST or not part < _LEFT:
            continue
        if share > _SHARE and (best is None or part < best[0]):
            best = part, lead, share
    if best is None:
        return _a_sample_late(axis)
    part, samples, share = best
    early, name = samples * grid.period, axis.command_name
    return [
        fault(
            KIND,
            name,
            f"the motion comes {1e3 * early:.3g} ms before {name}, which no machine makes: with the command so much"
            f" earlier, {100.0 * (1.0 - part):.0f} % less of the acceleration is left unexplained",
            f"subtract {early:.4g} s from the stamps of {name} ({late_option(early)}), or record both by one clock",
            evidence={LATE: early, "left": part, "share": share},
            spoils=("identification",),
        )
    ]


def _a_sample_late(axis: Axis) -> list[Finding]:
    """Name a command that acts half a sample before its stamps, where one in time acts half a sample after them.

    By the position: the noise of a velocity, from which a command was computed, looks like one that acts early. A body
    behind a spring moves that instant: what acts within a few samples must be the command.
    """
    plain = [one for one in responses(axis) if one.functions.power == PLAIN]
    if not plain or min(plain, key=lambda one: one.functions.width).share < _SHARE:
        return []
    place = axis.name("position")
    shown = decided(axis.input_time, axis.command, axis.time, axis.motions)
    if place not in shown or not all_near(shown, -0.5):
        return []
    name, (late, error) = axis.command_name, shown[place]
    return [
        fault(
            KIND,
            name,
            f"{name} acts {-late:.2g} ± {error:.1g} samples before its stamps by {place}, which no machine makes: it"
            " was recorded a sample late",
            f"subtract {axis.period:.4g} s from the stamps of {name} ({late_option(axis.period)}), or record what was"
            " sent before what was measured after it",
            evidence={LATE: axis.period, "late": late, "error": error},
            spoils=("delays",),
        )
    ]


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
