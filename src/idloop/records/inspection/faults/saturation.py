"""A command that a limit cuts off."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

# Share of the time at a limit, and visits to it.
_SHARE, _VISITS = 0.02, 3
# Distinct values of a continuous command, and the scatter of the slopes with which it arrives at the limit.
_VALUES, _SLOPES = 65, 0.1


def check(axis: Axis) -> list[Finding]:
    """Look for a varying command that stays at its largest or smallest value."""
    command = axis.command[np.isfinite(axis.command)]
    if command.size < 100 or np.unique(command).size < _VALUES:
        return []
    time = axis.input_time[np.isfinite(axis.command)]
    shares, places, largest = 0.0, [], 0.0
    for limit in (float(command.max()), float(command.min())):
        at = np.concatenate([[False], command == limit, [False]])
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        starts, stops = edges[::2], edges[1::2]
        held = (stops - starts >= 2) & (starts >= 2)
        # A ramp to a plateau arrives with one slope, a command that is cut with any.
        arrive = np.abs(command[starts[held] - 1] - command[starts[held] - 2])
        share = float(np.sum((stops - starts)[held])) / command.size
        if held.sum() < _VISITS or share < _SHARE or np.std(arrive) < _SLOPES * np.mean(arrive) or limit == 0.0:
            continue
        shares += share
        largest = max(largest, abs(limit), key=abs)
        places += [(float(time[a]), float(time[b - 1])) for a, b in zip(starts[held], stops[held], strict=True)]
    if not places:
        return []
    name, unit = axis.command_name, axis.unit("command")
    return [
        fault(
            "saturated_command",
            name,
            f"{name} is cut off at its limit ({largest:.4g} {unit}) {len(places)} times, {100 * shares:.2g} % of the"
            " time",
            "lower the amplitude or the gains of the loop where the cut is not wanted; the recorded command is used"
            " as it is",
            evidence={"limit": largest, "share": shares, "visits": float(len(places))},
            level="warning" if shares > 0.1 else "note",
            count=len(places),
            places=places,
        )
    ]
