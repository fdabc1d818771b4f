"""A command beyond what the drive applies: the acceleration stops growing with it."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import dry, regress, responses, unexplained

# Command levels tried, as shares of the largest; the gain beyond them is below this share of the gain up to there.
_LEVELS, _GAIN = (0.35, 0.5, 0.65, 0.8), 0.35
# Standard errors of the change of the gain, and of the gain itself.
_ERRORS = 6.0
# Share of the time beyond the level, and of the acceleration left by one gain that the change explains.
_BEYOND, _EXPLAINS = 0.05, 0.3
_FEWEST = 48
# Share of the acceleration above which the command as it is explains enough.
_ENOUGH = 0.99
# Share of the part beyond a level that must not follow from the command and a constant: of two levels all does.
_BENDS = 0.02


def check(axis: Axis, slower: float = np.inf) -> list[Finding]:
    """Add the part of the command beyond a level to the balance; its gain takes back that of the whole command.

    Only motion that is slower than a speed counts.
    """
    grid = axis.grid
    if grid is None or not np.isfinite(grid.command).any():
        return []
    largest = float(np.nanmax(np.abs(grid.command)))
    # A drag that grows faster than the speed, and friction that falls with it, are no limit of the drive.
    fading = np.exp(-np.abs(grid.speed) / max(float(np.nanstd(grid.speed)), 1e-300))
    drag = [grid.speed * np.abs(grid.speed), dry(grid) * fading]
    bent = [level for level in _LEVELS if _shows_bend(axis.command, level * largest)]
    parts = {level: _beyond(grid.command, level * largest) for level in bent}
    parts = {level: part for level, part in parts.items() if _BEYOND < np.mean(part != 0.0) < 1.0 - _BEYOND}
    # A test function with a sample that is too fast counts as unknown.
    fast = np.where(np.abs(grid.speed) > slower, np.nan, 0.0)
    best: tuple[float, float, float] | None = None
    for found in [one for one in responses(axis) if one.share < _ENOUGH]:
        others = np.column_stack([found.command, found.others, *(found.functions.project(one) for one in drag)])
        for level, part in parts.items():
            table = np.column_stack([found.functions.project(part), others])
            known = found.known & np.isfinite(table).all(axis=1) & np.isfinite(found.functions.project(fast))
            if np.count_nonzero(known) < _FEWEST:
                continue
            target = found.acceleration[known]
            values, errors, left = regress(target, table[known])
            without = unexplained(target, table[known][:, 1:])
            explains = 1.0 - left / without if without > 0.0 else 0.0
            certain = values[0] < -_ERRORS * errors[0] and values[1] > _ERRORS * errors[1]
            if certain and explains > _EXPLAINS and values[1] + values[0] < _GAIN * values[1]:
                best = max(best or (0.0, 0.0, 0.0), (explains, level * largest, float(1.0 + values[0] / values[1])))
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


def _beyond(command: Array, level: float) -> Array:
    """Part of a command (n,) beyond a level."""
    return np.asarray(np.sign(command) * np.maximum(np.abs(command) - level, 0.0))


def _shows_bend(command: Array, level: float) -> bool:
    """Whether a command (n,) as it was sent has values from which a bend at a level shows, beside a gain and an offset.

    Means of it over a sample have values between any two levels, which the drive never got.
    """
    known = command[np.isfinite(command)]
    beyond = _beyond(known, level)
    size = float(np.std(known) * np.std(beyond))
    shared = float(np.mean((known - known.mean()) * (beyond - beyond.mean()))) / size if size > 0.0 else 1.0
    return 1.0 - shared**2 > _BENDS
