"""Command and motion turned against each other: a positive command accelerates the axis backwards.

Then it also takes power from the motion on average, which a drive never does: friction needs power. Where the inertia
does not show, that power alone tells it, with a speed that is the larger the more is commanded: a load that drives the
axis, such as a weight that is lowered, is braked by more.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import PLAIN, Response, regress, response, responses, unexplained

# Standard errors of the gain below zero, and the share of the acceleration that it explains.
_ERRORS, _SHARE = 6.0, 0.2
# Of a steady motion: the share of the power that the command takes, and of what the command has beside acceleration and
# position the share that runs with the speed, with its standard errors; the command at rest in that at the top speed.
_TAKEN, _RUNS, _CERTAIN, _AT_REST = 0.99, 0.3, 3.0, 0.5
_FEWEST, _REST = 48, 0.02


def check(axis: Axis) -> list[Finding]:
    """Estimate the sign of the acceleration that the command gives, and of its power in steady motion."""
    found = response(axis, _SHARE)
    name, unit = axis.command_name, axis.unit("command")
    motion = axis.unit("position").removesuffix("/s")
    if found is not None and found.certainty <= -_ERRORS and _power(axis) <= 0.0:
        what = (
            f"a positive {name} accelerates {axis.joint} backwards ({found.gain:.3g} ± {found.error:.1g} {motion}/s²"
            f" per {unit}, {100 * found.share:.0f} % of it explained): the signs of command and motion differ"
        )
        evidence = {"gain": found.gain, "error": found.error, "share": found.share}
    elif (found is None or found.certainty < _CERTAIN) and (taken := _steadily_against(axis)):
        what = (
            f"{axis.joint} moves against {name} all the time ({100 * taken:.3g} % of its power is taken from the"
            f" motion), the faster the larger it is: the signs of command and motion differ, or something else drives"
            f" {axis.joint}"
        )
        evidence = {"taken": taken}
    else:
        return []
    cure = f"set `scale: -1` for {name} in the mapping, or allow a negative gain in the model file"
    return [fault("turned_command", name, what, cure, evidence=evidence, spoils=("identification",))]


def is_forwards(axis: Axis) -> bool:
    """Whether a positive command accelerates an axis forwards beyond doubt, and gives power to the motion."""
    found = response(axis, _SHARE)
    return found is not None and found.certainty > _ERRORS and _power(axis) > 0.0


def _power(axis: Axis) -> float:
    """Mean of command times speed."""
    return 0.0 if axis.grid is None else float(np.nanmean(axis.grid.command * axis.grid.speed))


def _steadily_against(axis: Axis) -> float:
    """Share of the power that the command takes from the motion, where it does so as a turned one; 0 elsewhere."""
    plain = (one for one in responses(axis) if one.functions.power == PLAIN)
    return max((_taken(axis, one) for one in plain), default=0.0)


def _taken(axis: Axis, balance: Response) -> float:
    grid = axis.grid
    if grid is None:
        return 0.0
    # Without a position that of the speed: a force that depends on it, such as the weight of an arm, is no friction.
    travelled = np.nancumsum(grid.speed) * grid.period
    place = balance.functions.project(grid.position if np.isfinite(grid.position).any() else travelled)
    speed = np.abs(balance.others[:, 0])
    moving = balance.known & np.isfinite(place) & (speed > _REST * np.nanmax(speed))
    if moving.sum() < _FEWEST:
        return 0.0
    power = (balance.command * balance.others[:, 0])[moving]
    taken = float(-np.sum(power[power < 0.0]) / max(np.sum(np.abs(power)), 1e-300))
    if taken < _TAKEN:
        return 0.0
    command, speed, place = balance.command[moving], balance.others[moving, 0], place[moving]
    scaled = (place - np.mean(place)) / max(float(np.ptp(place)), 1e-300)
    powers = scaled[:, None] ** np.arange(4)
    others = [powers, np.sin(place), np.cos(place), balance.acceleration[moving]]
    table = np.column_stack([speed, *others])
    values, errors, left = regress(command, table)
    alone = unexplained(command, table[:, 1:])
    top = float(abs(values[0]) * np.max(np.abs(speed)))
    slope = values[0] < -_CERTAIN * errors[0] and left < (1.0 - _RUNS) * alone
    return taken if slope and abs(values[1]) < _AT_REST * top else 0.0
