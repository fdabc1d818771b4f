"""All checks of one joint, in the order in which they are reported.

A check looks at one joint and returns findings with the evidence, the cure and what the fault spoils. Its thresholds
are in units of the scatter of the same record, for a false alarm in fewer than one of a hundred good records
(`benchmarks/inspection.py` counts them).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.differenced import differenced_columns
from idloop.records.inspection.faults import (
    command_sign,
    cut_command,
    drive_limits,
    excitation,
    jumps,
    late,
    loops,
    outside_force,
    readings,
    spikes,
    stamps,
)
from idloop.records.inspection.measured_input import KIND as MEASURED
from idloop.records.inspection.measured_input import measured_input
from idloop.records.inspection.velocity_check import KIND as WRONG_VELOCITY
from idloop.records.inspection.velocity_check import wrong_velocities

Check = Callable[[Axis], list[Finding] | Finding | None]

_BELOW = 0.9  # of the speed that an axis does not exceed


def _limit(axis: Axis) -> Finding | None:
    """Name one limit of the drive; what a limit of the force seems only near the largest speed is one of the speed."""
    force = drive_limits.limited_force(axis)
    if force and (speed := drive_limits.limited_speed(axis)):
        return force if drive_limits.limited_force(axis, _BELOW * abs(speed.evidence["speed"])) else speed
    other = force or drive_limits.limited_rate(axis) or drive_limits.limited_speed(axis)
    return other or cut_command.clipped_reading(axis)


def _late(axis: Axis) -> Finding | None:
    """Name a late velocity, or a late command: a late velocity makes the motion seem early."""
    return late.late_velocity(axis) or late.late_command(axis)


def _measured(axis: Axis) -> list[Finding]:
    """Name a command that was measured instead of commanded."""
    sent = axis.command
    return measured_input(axis.command_name, axis.input_time, sent, axis.time, axis.motions) if sent.size else []


# Checks of the signals; those of the response need a command and a motion that are what they say.
_JUMPS: tuple[Check, ...] = (jumps.spliced, jumps.missed_pulses)
_SIGNALS: tuple[Check, ...] = (
    stamps.two_publishers,
    stamps.two_clocks,
    stamps.of_reception,
    jumps.wrapped,
    readings.stuck,
    *_JUMPS,
    spikes.spikes,
    readings.coarse,
    cut_command.saturated,
    command_sign.lost_sign,
)
_RESPONSE: tuple[Check, ...] = (_late, command_sign.turned_command, _measured, _limit, excitation.weak)
# Faults after which the response of the axis means nothing.
_CONFUSES = {
    "sign_lost", "two_clocks", stamps.OFFSET, "two_publishers", loops.COPY, loops.SET_POINT, late.COMMAND,
    readings.STUCK,
}  # fmt: skip
# Faults that leave forces unexplained at some times: what jumps, or is limited.
_UNEXPLAINED = {
    *_CONFUSES, jumps.SPLICED, "missed_pulses", "lost_samples", "spikes", drive_limits.KIND, cut_command.CLIPPED,
}  # fmt: skip


def inspect_axis(axis: Axis) -> list[Finding]:
    """Return the faults of one joint; of one cause only the first is reported."""
    repeated = readings.repeated(axis)
    axis = readings.fresh(axis) if repeated else axis
    wrong = wrong_velocities(axis.time, axis.columns, axis.units) or differenced_columns(axis.time, axis.columns)
    found = [*wrong, *repeated]
    axis = replace(axis, trusts_velocity=not _any(found, {WRONG_VELOCITY}))

    def look(check: Check) -> None:
        seen = check(axis)
        found.extend(seen if isinstance(seen, list) else [seen] if seen else [])

    for check in _SIGNALS:
        # Where a sensor goes on after it stood still, the position jumps.
        if not (check in _JUMPS and _any(found, {readings.STUCK})):
            look(check)
    if _any(found, _CONFUSES):
        return found
    look(lambda axis: loops.copied_motion(axis) or loops.set_point(axis))
    if _any(found, _CONFUSES):
        return found
    for check in _RESPONSE:
        look(check)
        if _any(found, _CONFUSES):
            break
    if not _any(found, _UNEXPLAINED):
        look(lambda axis: outside_force.push(axis) or outside_force.changed_machine(axis))
    if _any(found, {cut_command.CLIPPED}):
        found = [one for one in found if one.kind != cut_command.SATURATED]
    # A command measured together with the motion contains what is new in it without any loop.
    if not _any(found, {MEASURED}):
        look(loops.feedback)
    return found


def _any(found: list[Finding], kinds: Collection[str]) -> bool:
    return any(one.kind in kinds for one in found)
