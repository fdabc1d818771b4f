"""Limit, widths and times of a compensator, with defaults for those that are not given."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.control.compensation import FORCE, INVERSE, SHIFT, TAKE_UP, Compensation, Plan, bodies_before
from idloop.errors import InputError
from idloop.physics.effect import COUPLING
from idloop.physics.model import Model
from idloop.signals.smooth import PEAK_ACCELERATION, PEAK_VELOCITY

# Default limit of the compensation, as a share of the controller's limit.
SHARE = 0.5
# Periods in which dry friction accelerates the machine to the speed below which it is cancelled in part.
PERIODS_TO_WIDTH = 2.0
# Share of the controller's limit that loads a contact whose friction grows with the load.
LOADED_SHARE = 0.1
# Least width of a smoothed step, relative to its height; and in standard deviations of the command from sensor noise
# alone, so that a machine at rest is not excited.
JUMP_SMOOTHED, DEVIATIONS = 0.25, 2.0
# Samples for the estimate of the latter.
NOISY_SAMPLES = 400
# Least periods in which a gap is crossed; and the share of the limit for the force across it.
PERIODS_TO_CROSS, PUSH_SHARE = 20.0, 0.5


@dataclass(frozen=True)
class Settings:
    """Every number of a compensator."""

    limit: float  # largest command that it adds, in its unit; infinite without a limit
    velocity_width: float  # speed below which dry friction is cancelled in part, in the unit of the bodies
    command_width: float  # size of a command below which the step of an inverse is applied in part, in its unit
    crossing_time: float  # time in which a gap is crossed [s]; 0 where there is none, as for the widths


def choose_settings(compensation: Compensation, plan: Plan, values: Mapping[str, Any]) -> Settings:
    """Fill in the settings that a compensation leaves open.

    `plan`: of it; `values`: controller, from ``check_controller``. Raises InputError: the limit is larger than the
    controller's.
    """
    model = compensation.model
    most = math.inf if values["limit"] is None else float(values["limit"])
    limit = compensation.limit
    if limit is not None and limit > most:
        raise InputError(f"compensation: limit {limit:g} is above the controller's limit {most:g}: lower it")
    if limit is None:
        limit = SHARE * most
    gain = abs(model.values["drive.gain"])
    period = float(values["sample_time"])
    inertia, _ = moved(model, model.bodies)
    dry = friction_sum(plan, LOADED_SHARE * gain * most if math.isfinite(most) else 0.0)
    lost, before = lost_way(plan, model)
    crossing = PERIODS_TO_CROSS * period if lost > 0.0 else 0.0
    if lost > 0.0 and math.isfinite(limit):
        crossing = max(crossing, _slow_enough(lost, *moved(model, before), PUSH_SHARE * limit * gain))
    return Settings(
        limit,
        compensation.velocity_width or PERIODS_TO_WIDTH * period * dry / inertia,
        compensation.command_width or _jump_width(plan, model, values),
        compensation.crossing_time or crossing,
    )


def _jump_width(plan: Plan, model: Model, values: Mapping[str, Any]) -> float:
    jump = largest_jump(plan)
    return max(JUMP_SMOOTHED * jump, DEVIATIONS * command_noise(model, values)) if jump > 0.0 else 0.0


def command_noise(model: Model, values: Mapping[str, Any]) -> float:
    """Standard deviation of the command from sensor noise alone, in the command's unit.

    `model`: whose outputs state their noise; `values`: controller, from ``check_controller``.
    """
    # Imported here because it compiles, which is only needed for an inverse with a step.
    from idloop.control.packing import pack
    from idloop.control.step import controller_step

    kernel = pack({**values, "limit": None})
    deviation = {output.name: output.noise or 0.0 for output in model.outputs}
    size = np.array([deviation[name] for name in kernel.inputs])
    if not np.any(size):
        return 0.0
    noise = size * np.random.default_rng(0).standard_normal((NOISY_SAMPLES, len(size)))
    state = kernel.state.copy()
    commands = [controller_step(kernel.kind, kernel.parameters, state, 0.0, 0.0, row) for row in noise]
    return float(np.std(commands))


def _slow_enough(way: float, inertia: float, viscous: float, force: float) -> float:
    """Time to move bodies over a distance on a quintic with at most this force [s]."""
    # Upper bound: the maxima of both terms are not at the same time.
    bend, speed = inertia * way * PEAK_ACCELERATION, viscous * way * PEAK_VELOCITY
    return (speed + math.sqrt(speed * speed + 4.0 * bend * force)) / (2.0 * force)


def lost_way(plan: Plan, model: Model) -> tuple[float, tuple[str, ...]]:
    """Lost motion at a reversal, and the bodies that are moved across it."""
    lost, before = 0.0, model.bodies
    for one in plan.of(TAKE_UP, SHIFT):
        lost += one.values[one.active.effect.lost_motion]
        if one.active.effect.site == COUPLING:
            before = min(before, bodies_before(model, one.active.at), key=len)
    return lost, before


def friction_sum(plan: Plan, arriving: float) -> float:
    """Breakaway level of all dry friction that is cancelled, in the unit of the drive's force.

    `arriving`: transmitted torque, for friction that depends on it.
    """
    total = 0.0
    for one in plan.of(FORCE):
        friction = one.active.effect.friction
        if friction is not None:
            numbers = [one.values[spec.name] for spec in one.active.effect.parameters]
            total += max(friction(side, 0.0, arriving, 0.0, [], numbers) for side in (1.0, -1.0))
    return total


def largest_jump(plan: Plan) -> float:
    """Half of the largest step of an inverse at zero, in the unit of the command."""
    found = 0.0
    for one in plan.of(INVERSE):
        numbers = [one.values[spec.name] for spec in one.active.effect.parameters]
        undo = one.active.effect.undo
        if undo is not None:
            low, middle, high = (undo(0.0, 0.0, side, 0.0, [], numbers) for side in (-1.0, 0.0, 1.0))
            found = max(found, abs(high - middle), abs(low - middle))
    return found


def moved(model: Model, bodies: Sequence[str]) -> tuple[float, float]:
    """Total inertia and viscous friction of bodies."""
    return (
        sum(model.values[f"{body}.inertia"] for body in bodies),
        sum(model.values[f"{body}.viscous_friction"] for body in bodies),
    )
