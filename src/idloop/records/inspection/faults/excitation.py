"""An excitation with two levels, too small, or too slow to show the inertia."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.command_sign import BACKWARD_TRAVEL, backward_travel
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.motion import white_noise
from idloop.records.inspection.response import plain_responses, response

TWO_LEVELS, SMALL, STILL, SLOW = "two_levels", "small_motion", "standstill", "weak_excitation"
# The axis moves by at least so many standard deviations of its noise, or of that of rounding to steps of its sensor.
_LEAST, _OF_ROUNDING = 20.0, 12.0**-0.5
_HELD = 0.85  # share of the time under a command in which the axis stands still
_REST = (0.002, 0.02)  # shares of the largest speed below which an axis stands still: at least, and at most for noise
# Standard errors of the gain below which the command shows no effect, and share of the command that friction and
# position explain where it is too slow.
_ERRORS, _FOLLOWS = 3.0, 0.8
# ... and how many times as many where the balance contains a resonance.
_RESONANT = 4.0
# ... and the share of the acceleration, beside friction, above which it is visible all the same, in one part only.
_VISIBLE = 0.3
# Share of the command that follows from speed, friction and position, above which the inertia makes less than three
# hundredths of it: less than what any friction law leaves.
_ALL = 0.999


def weak(axis: Axis) -> list[Finding]:
    """Look at levels, size and speed of the excitation."""
    known = axis.known_command
    if known.size < 2 or known.min() == known.max():
        return []
    found = [_levels(axis), _small(axis) or _still(axis) or _slow(axis)]
    return [one for one in found if one is not None]


def _levels(axis: Axis) -> Finding | None:
    levels = np.unique(axis.known_command)
    if levels.size > 2:
        return None
    name, unit = axis.command_name, axis.unit("command")
    return fault(
        TWO_LEVELS,
        name,
        f"{name} has two levels only ({levels[0]:.4g} and {levels[1]:.4g} {unit}): a dead zone, a saturation or a"
        " curved input characteristic looks like a gain and an offset",
        "use more levels to see them",
        evidence={"low": levels[0], "high": levels[1]},
        spoils=("dead zone", "limits of the drive"),
    )


def _small(axis: Axis) -> Finding | None:
    """Motion that hardly exceeds the noise and the steps of its sensor."""
    found = []
    for signal, value in axis.signals.items():
        values = value[np.isfinite(value)]
        if values.size < 30:
            continue
        low, high = np.percentile(values, [1.0, 99.0])
        if signal == "velocity":
            low, high = min(low, 0.0), max(high, 0.0)
        noise, step = white_noise(values), axis.resolution[signal]
        found.append((float(high - low) / max(noise, _OF_ROUNDING * step, 1e-300), signal, step > noise))
    ratio, signal, coarse = max(found, default=(_LEAST, "", False))
    if ratio >= _LEAST:
        return None
    unit, why, finer = "standard deviations of the noise", "the motion is lost in the noise", ""
    if coarse:
        ratio, unit, finer = ratio * _OF_ROUNDING, "steps of the sensor", ", or take a finer sensor"
        why = "its sensor is too coarse, or the motion too small"
    name, largest = axis.name(signal), float(np.nanmax(np.abs(axis.command)))
    return fault(
        SMALL,
        name,
        f"{name} moves by only {ratio:.2g} {unit} under {axis.command_name} up to {largest:.3g} {axis.unit('command')}:"
        f" {why}",
        f"command a larger motion{finer}",
        evidence={"ratio": ratio, "command": largest},
        spoils=("identification",),
    )


def _still(axis: Axis) -> Finding | None:
    """An axis that friction holds most of the time, although a command acts."""
    grid = axis.grid
    if grid is None:
        return None
    speed, command = np.abs(grid.speed), np.abs(grid.command)
    known = np.isfinite(speed) & np.isfinite(command)
    acts = known & (command > 0.05 * np.max(command[known], initial=0.0))
    top = float(np.max(speed[known], initial=0.0))
    still = speed < np.clip(3.0 * grid.noise, _REST[0] * top, _REST[1] * top)
    share = float(np.mean(still[acts])) if acts.any() else 0.0
    if share < _HELD:
        return None
    return fault(
        STILL,
        axis.joint,
        f"{axis.joint} stands still in {100 * share:.0f} % of the time in which {axis.command_name} acts: friction"
        " holds it",
        "command a larger or a longer motion",
        evidence={"share": share},
    )


def is_slow(fault: Finding) -> bool:
    """Whether a weak excitation is one that is too slow, and not one that shows no effect at all."""
    return fault.evidence["motion_share"] > _FOLLOWS


def _slow(axis: Axis) -> Finding | None:
    """A command that shows no effect on the acceleration."""
    found = response(axis)
    if found is None:
        return None
    # With the higher derivatives of a resonance more terms may look like the command by chance.
    visible = abs(found.certainty) > _RESONANT * _ERRORS
    if plain := plain_responses(axis):
        visible |= any(abs(one.certainty) > _ERRORS or one.share > _VISIBLE for one in plain)
        # A weight may be far larger than what accelerates its arm.
        beside = [one.gain_of(beside_position=True) for one in plain]
        visible |= any(one.certainty > _ERRORS and one.share > _VISIBLE for one in beside)
        found = max(plain, key=lambda one: abs(one.certainty))
    if visible and found.motion_share < _ALL:
        return None
    name, lost = axis.command_name, dict[str, float]()
    if found.motion_share > _FOLLOWS:
        explained = f"speed, friction and position explain {100 * found.motion_share:.0f} % of {name}"
        why = f"{explained}: what is left does not show the inertia"
        cure = "accelerate harder: faster changes of the command, or steps"
    else:
        hidden = f"{name} has no visible effect on the acceleration ({found.certainty:.2g} standard errors)"
        why = f"{hidden}: noise, or other forces, are larger"
        cure = "command more, record longer, or check that command and motion are of the same joint"
        if back := backward_travel(axis):
            lost = {BACKWARD_TRAVEL: back}
            sign = f"check that the sign of {name} was recorded, which never changes while the axis goes both ways"
            cure = f"{sign}; {cure}"
    evidence = {"certainty": found.certainty, "motion_share": found.motion_share, **lost}
    return fault(SLOW, name, why, cure, evidence=evidence, spoils=("inertia",))
