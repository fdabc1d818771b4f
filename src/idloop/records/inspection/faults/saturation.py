"""A command that a limit cuts off."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

# Share of the time at a limit, and visits to it.
_SHARE, _VISITS = 0.02, 2
# Share of the samples elsewhere that repeat the one before.
_HELD = 0.2
# Distinct values of a continuous command, and the scatter of the slopes with which it arrives at the limit.
_VALUES, _SLOPES = 65, 0.1


def check(axis: Axis) -> list[Finding]:
    """Look for a varying command that stays at its largest or smallest value."""
    command = axis.command[np.isfinite(axis.command)]
    if command.size < 100 or np.unique(command).size < _VALUES:
        return []
    time = axis.input_time[np.isfinite(axis.command)]
    places, arrivals, held_samples = [], [], 0
    limits = [one for one in (float(command.max()), float(command.min())) if one != 0.0]
    for limit in limits:
        at = np.concatenate([[False], command == limit, [False]])
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        starts, stops = edges[::2], edges[1::2]
        held = (stops - starts >= 2) & (starts >= 2)
        # A ramp to a plateau arrives with one slope, a command that is cut with any.
        arrivals += np.abs(command[starts[held] - 1] - command[starts[held] - 2]).tolist()
        held_samples += int(np.sum((stops - starts)[held]))
        places += [(float(time[a]), float(time[b - 1])) for a, b in zip(starts[held], stops[held], strict=True)]
    share = held_samples / command.size
    free = ~np.isin(command[:-1], limits)
    # A staircase holds every value, not only its limits.
    if np.mean(np.diff(command)[free] == 0.0) > _HELD:
        return []
    if len(places) < _VISITS or share < _SHARE or np.std(arrivals) < _SLOPES * np.mean(arrivals):
        return []
    largest = max(limits, key=abs)
    name, unit = axis.command_name, axis.unit("command")
    return [
        fault(
            "saturated_command",
            name,
            f"{name} is cut off at its limit ({largest:.4g} {unit}) {len(places)} times, {100 * share:.2g} % of the"
            " time",
            "lower the amplitude or the gains of the loop where the cut is not wanted; the recorded command is used"
            " as it is",
            evidence={"limit": largest, "share": share, "visits": float(len(places))},
            count=len(places),
            places=places,
        )
    ]
