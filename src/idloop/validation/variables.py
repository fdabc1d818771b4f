"""The variables along which an error is broken down, and the bins of each."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.validation.breakdown import Breakdown, break_down, sums
from idloop.validation.edges import MOST_BINS, few_levels, level_edges, round_edges, since_edges
from idloop.validation.operating_state import OperatingState
from idloop.validation.spectrum import by_frequency

TITLES = {
    "time": "time",
    "frequency": "frequency",
    "velocity": "velocity",
    "position": "position",
    "command": "command",
    "direction": "direction",
    "since_reversal": "time since reversal",
}
VARIABLES = tuple(TITLES)

_STRETCHES = 10  # of equal duration


def break_down_all(error: Array, signal: Array, state: OperatingState) -> tuple[tuple[Breakdown, ...], dict[str, str]]:
    """Break an error down along every variable that varies.

    `error`, `signal` (n,): error and the measured signal it belongs to; finite, at the instants of `state`. Returns
    `breakdowns`: in the order of `VARIABLES`; `left_out`: reason by variable that is missing.
    """
    time = state.time
    found = [
        break_down("time", "time", "s", time, error, np.linspace(time[0], time[-1], _STRETCHES + 1)),
        by_frequency(time, error, signal),
    ]
    left_out: dict[str, str] = {}
    if state.velocity is None or state.direction is None or state.since is None:
        left_out |= dict.fromkeys(("velocity", "direction", "since_reversal"), "no motion is measured")
    else:
        edges = round_edges(state.velocity, state.floor)
        unit = f"{state.position_unit}/s"
        if np.ptp(state.velocity) > 0.0:
            found.append(break_down("velocity", f"velocity of {state.body}", unit, state.velocity, error, edges))
        else:
            left_out["velocity"] = "the velocity never changes"
        found.append(_by_direction(error, state.direction, state.body))
        if np.any(np.isfinite(state.since)):
            found.append(_by_since(error, state.since))
        else:
            left_out["since_reversal"] = "the axis never reverses"
    if state.position is None:
        left_out["position"] = "no position is measured"
    elif np.ptp(state.position) > 0.0:
        found.append(_by_position(error, state))
    else:
        left_out["position"] = "the position never changes"
    if np.ptp(state.command) > 1e-9 * np.max(np.abs(state.command)):
        found.append(_by_command(error, state))
    else:
        left_out["command"] = "the command never changes"
    return tuple(sorted(found, key=lambda b: VARIABLES.index(b.variable))), left_out


def _by_direction(error: Array, direction: Array, body: str) -> Breakdown:
    kinds = ("moving backward", "standing", "moving forward")
    index = np.asarray(direction + 1.0).astype(np.int64)
    return Breakdown("direction", f"direction of {body}", "", None, kinds, *sums(index, error, 3))


def _by_since(error: Array, since: Array) -> Breakdown:
    known = np.isfinite(since)
    beyond = "" if np.all(known) else "before the first reversal"
    edges = since_edges(since[known])
    return break_down("since_reversal", "time since reversal", "s", since, error, edges, beyond)


def _by_position(error: Array, state: OperatingState) -> Breakdown:
    position, label = np.asarray(state.position), f"position of {state.body}"
    if state.position_unit == "rad" and np.ptp(position) >= 2.0 * np.pi:
        angle = np.degrees(np.mod(position, 2.0 * np.pi))
        edges = np.linspace(0.0, 360.0, MOST_BINS + 1)
        return break_down("position", label, "°", angle, error, edges, circular=True)
    return break_down("position", label, state.position_unit, position, error, round_edges(position))


def _by_command(error: Array, state: OperatingState) -> Breakdown:
    levels = few_levels(state.command)
    edges = round_edges(state.command) if levels is None else level_edges(levels)
    return break_down("command", "command", state.command_unit, state.command, error, edges, levels=levels)
