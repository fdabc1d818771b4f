"""A loop in the drive: the command is a set-point that position or velocity follow, no force."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import PLAIN, Response, regress, responses, unexplained
from idloop.records.tables.base_units import base_unit

KIND = "inner_loop"
# The motion follows a set-point with this gain, and this share of its power.
_GAIN, _FOLLOWS = 0.03, 0.97
_POSITION, _VELOCITY = (
    ("rad", "deg", "rev", "m", "mm", "cm", "counts"),
    ("rad/s", "rpm", "deg/s", "rev/s", "m/s", "mm/s"),
)
_LAGS, _FEWEST = 24, 60  # delays, and samples that they leave
# In the balance of a position loop the position has this factor, to this accuracy, explains this share of the command
# beside what moves the axis, and leaves so little of it.
_FACTOR, _EXACT, _OWN, _WHOLE = 0.02, 0.01, 0.9, 0.98
_NO_FORCE = ("", "-")
# Units in which a set-point may be that has none, by the unit of the motion.
_USUAL = {
    "rad": ("rad", "deg", "rev"), "m": ("m", "mm"), "rad/s": ("rad/s", "rpm", "deg/s"), "m/s": ("m/s", "mm/s"),
}  # fmt: skip
_WITH_POSITION = 4  # columns beside the command: speed, its sign, constant, position


def check(axis: Axis) -> list[Finding]:
    """Look at the unit and the field of the command, and whether the motion follows it one to one."""
    if not axis.command.size or axis.grid is None:
        return []
    unit = axis.units.get(axis.command_name, "")
    field = axis.command_name.rpartition(".")[2]
    grid = axis.grid
    found: list[tuple[str, str, float, float]] = []
    for signal, value in (("position", grid.position), ("velocity", grid.speed)):
        # A force may give a speed of the same number; a force that gives a position of it is a set-point.
        if signal == "velocity" and unit not in (*_NO_FORCE, *_VELOCITY):
            continue
        gain, share = _follows(grid.command, value)
        found += [
            (signal, name, gain / factor, share)
            for name, factor in _units(axis, signal, unit)
            if abs(gain / factor - 1.0) < _GAIN and share > _FOLLOWS
        ]
    loop = None if found or unit not in _NO_FORCE else _position_loop(axis, _units(axis, "position", unit))
    by_unit = "position" if unit in _POSITION else "velocity" if unit in _VELOCITY else ""
    by_field = field if field in ("position", "velocity") and not unit else ""
    if not (found or loop or by_unit or by_field):
        return []
    if loop is not None:
        found = [("position", *loop)]
    signal, taken, gain, share = found[0] if found else (by_unit or by_field, unit, np.nan, np.nan)
    name, read = axis.command_name, f", read in {taken}," if found and unit in _NO_FORCE else ""
    why = (
        f"beside speed, friction and acceleration {axis.name(signal)} is in it{read} with a factor of {gain:.3f}, as in"
        f" a loop ({100 * share:.1f} % of its power)"
        if loop
        else f"{axis.name(signal)} follows it{read} with a gain of {gain:.3f} ({100 * share:.1f} % of its power)"
        if found
        else f"it is given in {unit}"
        if by_unit
        else f"it is sent as a {field}"
    )
    return [
        fault(
            KIND,
            name,
            f"{name} is a set-point of the {signal}: {why}; a controller inside the drive makes the force",
            "record the current or the torque of the drive as the command, or model the loop of the drive: "
            f"`drive: {{kind: {signal}_loop}}`",
            evidence={"gain": gain, "share": share, taken: 1.0} if found else {},
            spoils=("inertia and friction",),
        )
    ]


def unit_of_set_point(finding: Finding) -> str:
    """Return the unit in which the motion follows the command one to one; empty where a finding says none."""
    usual = [unit for units in _USUAL.values() for unit in units]
    return next((unit for unit in usual if finding.kind == KIND and unit in finding.evidence), "")


def _units(axis: Axis, signal: str, unit: str) -> list[tuple[str, float]]:
    """Units in which a command may be a set-point of a signal, with their factors to that of the signal."""
    own = axis.unit(signal)
    names = _USUAL.get(own, (own,)) if unit in _NO_FORCE else (own,)
    return [(name, base_unit(name, signal, "")[1] if name != own else 1.0) for name in names]


def _position_loop(axis: Axis, units: list[tuple[str, float]]) -> tuple[str, float, float] | None:
    """Unit of the command, factor of the position in it, and the share that its balance explains, of a loop.

    A controller whose force is ``stiffness (command - position) - damping speed`` makes the command the position plus
    what is proportional to speed, friction and acceleration, however softly the motion follows it. The command of a
    force holds no position, or as much of it as there is of a spring.
    """
    found: tuple[float, str, float, float] | None = None
    for one in responses(axis):
        if one.functions.power != PLAIN or one.others.shape[1] < _WITH_POSITION:
            continue
        factor, error, share, own = _balance(one)
        for name, times in units:
            if times * error < _EXACT and abs(times * factor - 1.0) < _FACTOR and own > _OWN and share > _WHOLE:
                this = (times * error, name, times * factor, share)
                found = min(found or this, this)
    return None if found is None else found[1:]


def _balance(one: Response) -> tuple[float, float, float, float]:
    """Factor of the position in the command, its error, the share explained, and the share that the position adds."""
    command = one.command[one.known]
    speed, friction, constant, place = one.others[one.known][:, :_WITH_POSITION].T
    moves = np.column_stack([speed, friction, one.acceleration[one.known], constant])
    values, errors, left = regress(command, np.column_stack([place, moves]))
    alone = unexplained(command, moves)
    power = float(np.var(command))
    share, own = (1.0 - left / whole if whole > 0.0 else 0.0 for whole in (power, alone))
    return float(values[0]), float(errors[0]), share, own


def _follows(command: Array, value: Array) -> tuple[float, float]:
    """Gain and share of the power with which a signal follows the command some samples later, by the best delay."""
    best = (0.0, 0.0)
    for lag in range(_LAGS):
        u, y = command[: command.size - lag], value[lag:]
        known = np.isfinite(u) & np.isfinite(y)
        if known.sum() < _FEWEST:
            continue
        u, y = u[known] - np.mean(u[known]), y[known] - np.mean(y[known])
        power, both, motion = float(u @ u), float(u @ y), float(y @ y)
        if power > 0.0 and motion > 0.0 and both**2 / (power * motion) > best[1]:
            best = (both / power, both**2 / (power * motion))
    return best
