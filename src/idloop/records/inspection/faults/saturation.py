"""A command that a limit cuts off."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

KIND = "saturated_command"
# Share of the time at a limit.
_SHARE = 0.02
# Share of the samples elsewhere that repeat the one before.
_HELD = 0.2
# Distinct values of a continuous command, and the change of the slope with which it comes to the limit or leaves it,
# over this share of the time there.
_VALUES, _SLOPES, _BEFORE = 65, 0.1, 0.25


def check(axis: Axis) -> list[Finding]:
    """Look for a varying command that stays at its largest or smallest value."""
    command = axis.command[np.isfinite(axis.command)]
    if command.size < 100 or np.unique(command).size < _VALUES:
        return []
    time = axis.input_time[np.isfinite(axis.command)]
    places, slopes, earlier = [], [], []
    held: dict[float, int] = {}
    limits = [one for one in (float(command.max()), float(command.min())) if one != 0.0]
    for limit in limits:
        at = np.concatenate([[False], command == limit, [False]])
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
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
    free = ~np.isin(command[:-1], limits)
    # A staircase holds every value, not only its limits.
    if np.mean(np.diff(command)[free] == 0.0) > _HELD:
        return []
    if not slopes or share < _SHARE:
        return []
    # A ramp to a plateau comes with one slope, that of a command that is cut changes.
    steep = float(np.mean(slopes))
    if np.mean(np.abs(np.subtract(slopes, earlier))) < _SLOPES * steep:
        return []
    # One that settles at its end comes without a slope.
    if steep < _SLOPES * float(np.mean(np.abs(np.diff(command)[free]))):
        return []
    largest = max(held, key=lambda limit: held[limit])
    many = "once" if len(places) == 1 else f"{len(places)} times"
    name, unit = axis.command_name, axis.unit("command")
    return [
        fault(
            KIND,
            name,
            f"{name} is cut off at its limit ({largest:.4g} {unit}) {many}, {100 * share:.2g} % of the time",
            "lower the amplitude or the gains of the loop where the cut is not wanted; the recorded command is used"
            " as it is",
            evidence={"limit": largest, "share": share, "visits": float(len(places))},
            count=len(places),
            places=places,
        )
    ]
