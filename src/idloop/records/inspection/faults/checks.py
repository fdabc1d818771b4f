"""All checks of one joint, in the order in which they are reported."""

from __future__ import annotations

from dataclasses import replace

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import (
    clipped_reading,
    clocks,
    command_direction,
    command_sign,
    copied_motion,
    excitation,
    feedback,
    inner_loop,
    late_command,
    late_velocity,
    measured_command,
    missed_pulses,
    not_followed,
    outside_force,
    publishers,
    quantisation,
    rate_limit,
    repeated_samples,
    saturation,
    speed_limit,
    spikes,
    spliced,
    stamps,
    stuck_sensor,
    wrap,
    wrong_velocity,
)
from idloop.records.inspection.faults.fault import Check
from idloop.records.inspection.measured_input import KIND as MEASURED
from idloop.records.inspection.velocity_check import KIND as WRONG_VELOCITY

_BELOW = 0.9  # of the speed that an axis does not exceed


def _limit(axis: Axis) -> list[Finding]:
    """Name one limit of the drive; what a limit of the force seems only near the largest speed is one of the speed."""
    force = not_followed.check(axis)
    if force and (speed := speed_limit.check(axis)):
        return force if not_followed.check(axis, _BELOW * abs(speed[0].evidence["speed"])) else speed
    return force or rate_limit.check(axis) or speed_limit.check(axis) or clipped_reading.check(axis)


def _late(axis: Axis) -> list[Finding]:
    """Name a late velocity, or a late command: a late velocity makes the motion seem early."""
    return late_velocity.check(axis) or late_command.check(axis)


# Checks of the signals; those of the response need a command and a motion that are what they say.
_SIGNALS: tuple[Check, ...] = (
    publishers.check,
    clocks.check,
    stamps.check,
    wrap.check,
    stuck_sensor.check,
    spliced.check,
    missed_pulses.check,
    spikes.check,
    quantisation.check,
    saturation.check,
    command_sign.check,
)
_JUMPS: tuple[Check, ...] = (spliced.check, missed_pulses.check)
_RESPONSE: tuple[Check, ...] = (
    _late,
    command_direction.check,
    measured_command.check,
    _limit,
    excitation.check,
)
# Faults after which the response of the axis means nothing.
_CONFUSES = {
    "sign_lost", "two_clocks", clocks.OFFSET, "two_publishers", copied_motion.KIND, inner_loop.KIND, late_command.KIND,
    stuck_sensor.KIND,
}  # fmt: skip
# Faults that leave forces unexplained at some times.
_UNEXPLAINED = {*_CONFUSES, "spliced", "missed_pulses", "lost_samples", "spikes", "not_followed", clipped_reading.KIND}


def inspect_axis(axis: Axis) -> list[Finding]:
    """Return the faults of one joint; of one cause only the first is reported."""
    repeated = repeated_samples.check(axis)
    axis = repeated_samples.fresh(axis) if repeated else axis
    found = [*wrong_velocity.check(axis), *repeated]
    wrong = any(one.kind == WRONG_VELOCITY for one in found)
    axis = replace(axis, trusts_velocity=not wrong)
    for check in _SIGNALS:
        # Where a sensor goes on after it stood still, the position jumps.
        if not (check in _JUMPS and any(one.kind == stuck_sensor.KIND for one in found)):
            found += check(axis)
    if not any(one.kind in _CONFUSES for one in found):
        found += copied_motion.check(axis) or inner_loop.check(axis)
    if not any(one.kind in _CONFUSES for one in found):
        for check in _RESPONSE:
            found += check(axis)
            if any(one.kind in _CONFUSES for one in found):
                break
        # What jumps, or is limited, leaves forces that the command does not explain as well.
        if not any(one.kind in _UNEXPLAINED for one in found):
            found += outside_force.check(axis)
        if any(one.kind == clipped_reading.KIND for one in found):
            found = [one for one in found if one.kind != saturation.KIND]
        # A command measured together with the motion contains what is new in it without any loop.
        if not any(one.kind == MEASURED for one in found):
            found += feedback.check(axis)
    return found
