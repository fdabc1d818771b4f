"""A loop in the drive: the command is a set-point that position or velocity follow, no force."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis, Floats
from idloop.records.inspection.faults.fault import fault

# The motion follows a set-point with this gain, and this share of its power.
_GAIN, _FOLLOWS = 0.03, 0.97
_POSITION, _VELOCITY = (
    ("rad", "deg", "rev", "m", "mm", "cm", "counts"),
    ("rad/s", "rpm", "deg/s", "rev/s", "m/s", "mm/s"),
)
_LAGS = 24


def check(axis: Axis) -> list[Finding]:
    """Look at the unit and the field of the command, and whether the motion follows it one to one."""
    if not axis.command.size or axis.grid is None:
        return []
    unit = axis.units.get(axis.command_name, "")
    field = axis.command_name.rpartition(".")[2]
    grid = axis.grid
    found: list[tuple[str, float, float]] = []
    for signal, value in (("position", grid.position), ("velocity", grid.speed)):
        # A force may give a speed of the same number; a force that gives a position of it is a set-point.
        if signal == "velocity" and unit and unit not in _VELOCITY:
            continue
        gain, share = _follows(grid.command, value)
        if abs(gain - 1.0) < _GAIN and share > _FOLLOWS:
            found.append((signal, gain, share))
    by_unit = "position" if unit in _POSITION else "velocity" if unit in _VELOCITY else ""
    by_field = field if field in ("position", "velocity") and not unit else ""
    if not (found or by_unit or by_field):
        return []
    signal, gain, share = found[0] if found else (by_unit or by_field, np.nan, np.nan)
    name = axis.command_name
    why = (
        f"{axis.name(signal)} follows it with a gain of {gain:.3f} ({100 * share:.1f} % of its power)"
        if found
        else f"it is given in {unit}"
        if by_unit
        else f"it is sent as a {field}"
    )
    return [
        fault(
            "inner_loop",
            name,
            f"{name} is a set-point of the {signal}: {why}; a controller inside the drive makes the force",
            "record the current or the torque of the drive as the command, or model the loop of the drive",
            evidence={"gain": gain, "share": share} if found else {},
            spoils=("inertia and friction",),
        )
    ]


def _follows(command: Floats, value: Floats) -> tuple[float, float]:
    """Gain and share of the power with which a signal follows the command some samples later, by the best delay."""
    best = (0.0, 0.0)
    for lag in range(_LAGS):
        u, y = command[: command.size - lag], value[lag:]
        known = np.isfinite(u) & np.isfinite(y)
        if known.sum() < 100:
            continue
        u, y = u[known] - np.mean(u[known]), y[known] - np.mean(y[known])
        power, both, motion = float(u @ u), float(u @ y), float(y @ y)
        if power > 0.0 and motion > 0.0 and both**2 / (power * motion) > best[1]:
            best = (both / power, both**2 / (power * motion))
    return best
