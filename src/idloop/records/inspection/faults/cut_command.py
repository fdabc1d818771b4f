"""A command at its limit: cut off before it was sent, or by the sensor that measured it."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault, times
from idloop.records.inspection.response import curved_friction, own_share, regress, responses, unexplained
from idloop.records.inspection.values import runs

SATURATED, CLIPPED = "saturated_command", "clipped_reading"

_SHARE = 0.02  # of the time at a limit
# Distinct values of a continuous command; share of the samples elsewhere that repeat the one before.
_VALUES, _HELD = 65, 0.2
# Change of the slope with which it comes to the limit or leaves it, over this share of the time there.
_SLOPES, _BEFORE = 0.1, 0.25
# Of a reading: its part in the balance that nothing else there explains. What acts at the limit beside it: its share of
# the limit, its standard errors, and the share of the acceleration left without it that it explains.
_OWN, _MORE, _ERRORS, _EXPLAINS = 0.05, 0.05, 3.5, 0.1
_DEAD = 0.2  # a dead zone within this part of the limit


def saturated(axis: Axis) -> Finding | None:
    """Look for a varying command that stays at its largest or smallest value."""
    command = axis.known_command
    if command.size < 100 or np.unique(command).size < _VALUES:
        return None
    time = axis.input_time[np.isfinite(axis.command)]
    places, slopes, earlier = [], [], []
    held: dict[float, int] = {}
    limits = [one for one in (float(command.max()), float(command.min())) if one != 0.0]
    for limit in limits:
        for start, stop in runs(command == limit):
            if stop - start < 2 or start < 2:
                continue
            held[limit] = held.get(limit, 0) + stop - start
            places.append((float(time[start]), float(time[stop - 1])))
            away = 1 + int(_BEFORE * (stop - start))
            for path in (command[:start][::-1], command[stop:]):
                if path.size > away + 1:
                    slopes.append(abs(float(path[0] - path[1])))
                    earlier.append(abs(float(path[away] - path[away + 1])))
    share = sum(held.values()) / command.size
    change = np.diff(command)[~np.isin(command[:-1], limits)]
    # A staircase holds every value, not only its limits.
    if np.mean(change == 0.0) > _HELD or not slopes or share < _SHARE:
        return None
    # A ramp to a plateau comes with one slope, that of a command that is cut changes; one that settles has none.
    steep, bent = float(np.mean(slopes)), float(np.mean(np.abs(np.subtract(slopes, earlier))))
    if bent < _SLOPES * steep or steep < _SLOPES * float(np.mean(np.abs(change))):
        return None
    largest = max(held, key=lambda limit: held[limit])
    name, unit = axis.command_name, axis.unit("command")
    return fault(
        SATURATED,
        name,
        f"{name} is cut off at its limit ({largest:.4g} {unit}) {times(len(places))}, {100 * share:.2g} % of the time",
        "lower the amplitude or the gains of the loop where the cut is not wanted; the recorded command is used as it"
        " is",
        evidence={"limit": largest, "share": share, "visits": len(places)},
        places=places,
    )


def clipped_reading(axis: Axis) -> Finding | None:
    """A measured command that its sensor cuts off: at the limit of the reading the acceleration goes on growing.

    What acts only while the command stands at its limit is added to the balance.
    """
    grid, command = axis.grid, axis.known_command
    if grid is None or not command.size:
        return None
    limits = [one for one in (float(command.min()), float(command.max())) if one != 0.0]
    held = {limit: float(np.mean(command == limit)) for limit in limits}
    limits = [limit for limit in limits if held[limit] > _SHARE and np.sign(limit) == np.sign(limit - np.mean(command))]
    if not limits:
        return None
    size = float(np.mean(np.abs(limits)))
    at_limit = np.sum([np.sign(limit) * np.isclose(grid.command, limit, rtol=1e-9) for limit in limits], axis=0)
    at_limit = np.where(np.isfinite(grid.command), at_limit, np.nan)
    beside = [*curved_friction(grid), np.clip(grid.command, -_DEAD * size, _DEAD * size)]
    if np.unique(command).size < _VALUES:
        # Of few levels the largest shows a thrust or a torque that grows faster than its command as well.
        beside.append(grid.command * np.abs(grid.command))
    explains, more = 0.0, 0.0
    for one in responses(axis):
        target, table = one.with_terms(at_limit, beside)
        if target.size < table.shape[1] * 4:
            continue
        values, errors, left = regress(target, table)
        certain = (values > _ERRORS * errors)[:2].all() and values[0] > _MORE * size * values[1]
        own = unexplained(table[:, 0], table[:, 1:]) / max(float(np.mean(table[:, 0] ** 2)), 1e-300)
        if certain and own >= _OWN and (share := own_share(target, table, left)) >= _EXPLAINS:
            explains, more = max((explains, more), (share, float(values[0] / values[1])))
    if not more:
        return None
    name, unit = axis.command_name, axis.unit("command")
    share = sum(held[limit] for limit in limits)
    ends = " and ".join(f"{limit:.4g}" for limit in limits)
    return fault(
        CLIPPED,
        name,
        f"{name} stands at {ends} {unit} in {100.0 * share:.2g} % of the time, but the axis accelerates there as under"
        f" {more:.2g} {unit} more: the sensor cuts off what acts",
        "record it with a larger range, or with a smaller amplitude",
        evidence={"limit": size, "more": more, "explains": explains, "share": share},
        spoils=("inertia and friction",),
    )
