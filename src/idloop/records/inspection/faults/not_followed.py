"""A command beyond what the drive applies: the acceleration stops growing with it."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import dry, regress, response

# Command levels tried, as shares of the largest; the gain beyond them is below this share of the gain up to there.
_LEVELS, _GAIN = (0.35, 0.5, 0.65, 0.8), 0.35
# Standard errors of the change of the gain, and of the gain itself.
_ERRORS, _CERTAIN = 6.0, 8.0
# Share of the time beyond the level, and of the acceleration left by one gain that the change explains.
_BEYOND, _EXPLAINS = 0.05, 0.2


def check(axis: Axis) -> list[Finding]:
    """Add the part of the command beyond a level to the balance; its gain takes back that of the whole command."""
    found, grid = response(axis), axis.grid
    if found is None or grid is None or found.certainty < _CERTAIN:
        return []
    largest = float(np.nanmax(np.abs(grid.command)))
    speed = grid.speed
    # A drag that grows faster than the speed, and friction that falls with it, are no limit of the drive.
    drag = [
        found.functions.project(one)
        for one in (speed * np.abs(speed), dry(grid) * np.exp(-np.abs(speed) / max(float(np.nanstd(speed)), 1e-300)))
    ]
    best: tuple[float, float, float] | None = None
    for level in _LEVELS:
        beyond = np.sign(grid.command) * np.maximum(np.abs(grid.command) - level * largest, 0.0)
        if np.mean(beyond != 0.0) < _BEYOND or np.mean(beyond == 0.0) < _BEYOND:
            continue
        table = np.column_stack([found.functions.project(beyond), found.command, found.others, *drag])
        known = found.known & np.isfinite(table).all(axis=1)
        target = found.acceleration[known]
        values, errors, left = regress(target, table[known])
        without = regress(target, table[known][:, 1:])[2]
        kept = 1.0 + values[0] / values[1] if values[1] > 0.0 else 1.0
        certain = values[0] < -_ERRORS * errors[0] and kept < _GAIN and values[1] > _ERRORS * errors[1]
        if certain and 1.0 - left / without > _EXPLAINS and (best is None or left < best[0]):
            best = (left, level * largest, kept)
    if best is None:
        return []
    _, level, kept = best
    name, unit = axis.command_name, axis.unit("command")
    return [
        fault(
            "not_followed",
            name,
            f"beyond {level:.3g} {unit} the acceleration grows with {name} only {100 * max(kept, 0.0):.0f} % as much as"
            f" below (command up to {largest:.3g} {unit}): the drive limits it",
            "keep the command below the limit, or add `saturation@input` to the effects of the model file",
            evidence={"level": level, "gain_beyond": kept, "largest": largest},
        )
    ]
