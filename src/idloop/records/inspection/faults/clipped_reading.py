"""A measured command that its own sensor cuts off: at the limit of the reading the acceleration goes on growing."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import dry, regress, responses, unexplained

KIND = "clipped_reading"
# Share of the time at a limit, and of its part in the balance that nothing else there explains.
_SHARE, _OWN = 0.02, 0.05
# What acts at the limit beside the reading: its share of the limit, its standard errors, and the share of the
# acceleration left without it that it explains.
_MORE, _ERRORS, _EXPLAINS = 0.05, 3.5, 0.1
# Distinct values of a command that was measured.
_LEVELS = 65
# A dead zone within this part of the limit.
_DEAD = 0.2


def check(axis: Axis) -> list[Finding]:
    """Add what acts only while the command stands at its limit to the balance."""
    grid, command = axis.grid, axis.command[np.isfinite(axis.command)]
    if grid is None or not command.size:
        return []
    limits = [one for one in (float(command.min()), float(command.max())) if one * np.sign(one) > 0.0]
    held = {limit: float(np.mean(command == limit)) for limit in limits}
    limits = [limit for limit in limits if held[limit] > _SHARE and np.sign(limit) == np.sign(limit - np.mean(command))]
    if not limits:
        return []
    size = float(np.mean(np.abs(limits)))
    at_limit = np.sum([np.sign(limit) * np.isclose(grid.command, limit, rtol=1e-9) for limit in limits], axis=0)
    at_limit = np.where(np.isfinite(grid.command), at_limit, np.nan)
    fading = np.exp(-np.abs(grid.speed) / max(float(np.nanstd(grid.speed)), 1e-300))
    dead = np.clip(grid.command, -_DEAD * size, _DEAD * size)
    beside = [grid.speed * np.abs(grid.speed), dry(grid) * fading, dead]
    if np.unique(command).size < _LEVELS:
        # Of few levels the largest shows a thrust or a torque that grows faster than its command as well.
        beside.append(grid.command * np.abs(grid.command))
    best: tuple[float, float] | None = None
    for one in responses(axis):
        others = np.column_stack([one.command, one.others, *(one.functions.project(value) for value in beside)])
        table = np.column_stack([one.functions.project(at_limit), others])
        known = one.known & np.isfinite(table).all(axis=1)
        if np.count_nonzero(known) < table.shape[1] * 4:
            continue
        target, rows = one.acceleration[known], table[known]
        own = unexplained(rows[:, 0], rows[:, 1:])
        values, errors, left = regress(target, rows)
        without = unexplained(target, rows[:, 1:])
        more = float(values[0] / values[1]) if values[1] > _ERRORS * errors[1] else 0.0
        explains = 1.0 - left / without if without > 0.0 else 0.0
        if own < _OWN * float(np.mean(rows[:, 0] ** 2)) or explains < _EXPLAINS:
            continue
        if more > _MORE * size and values[0] > _ERRORS * errors[0]:
            best = max(best or (0.0, 0.0), (explains, more))
    if best is None:
        return []
    name, unit = axis.command_name, axis.unit("command")
    share = sum(held[limit] for limit in limits)
    ends = " and ".join(f"{limit:.4g}" for limit in limits)
    return [
        fault(
            KIND,
            name,
            f"{name} stands at {ends} {unit} in {100.0 * share:.2g} % of the time, but the axis accelerates there as"
            f" under {best[1]:.2g} {unit} more: the sensor cuts off what acts",
            "record it with a larger range, or with a smaller amplitude",
            evidence={"limit": size, "more": best[1], "explains": best[0], "share": share},
            spoils=("inertia and friction",),
        )
    ]
