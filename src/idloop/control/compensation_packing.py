"""Flat arrays of the compiled step for a compensation plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from idloop.control import step
from idloop.control.compensation import FORCE, INVERSE, SHIFT, Plan, followed_output
from idloop.control.compensation_settings import Settings, lost_way, moved
from idloop.control.packing import Kernel
from idloop.physics.model import Model


def add_compensation(kernel: Kernel, model: Model, plan: Plan, settings: Settings, values: Mapping[str, Any]) -> Kernel:
    """Add a compensator between the law and the limit of a controller.

    `kernel`: the controller alone; `model`: the fitted model of the machine; `values`: controller, from
    ``check_controller``. Returns: valid in this process only, since it contains addresses of machine code. Unchanged
    when nothing is cancelled.
    """
    if not plan.cancelled:
        return kernel
    followed = followed_output(model, values)
    start, memory = len(kernel.parameters), len(kernel.state)
    inverses, forces = plan.of(INVERSE), plan.of(FORCE)
    lost, before = lost_way(plan, model)
    inertia, viscous = moved(model, before)
    # Force and friction of an effect have a row each.
    equations = [one for effect in forces for one in (effect.active.effect.force, effect.active.effect.friction) if one]
    head = {
        step.MEMORY: memory,
        step.MOST: settings.limit,
        step.COMMAND_WIDTH: settings.command_width,
        step.VELOCITY_WIDTH: settings.velocity_width,
        step.PER_REFERENCE: 1.0 if followed is None else 1.0 / (values.get("feedback_gain", 1.0) * followed.scale),
        step.GIVES_VELOCITY: followed is not None and followed.field == "velocity",
        step.DRIVE_GAIN: model.values["drive.gain"],
        step.GAP: lost,
        step.GAP_SHIFTS: bool(plan.of(SHIFT)),
        step.GAP_INERTIA: inertia,
        step.GAP_VISCOUS: viscous,
        step.CROSSING_TIME: settings.crossing_time,
        step.INVERSES: len(inverses),
        step.FORCES: len(equations),
    }
    next_number = start + len(head) + step.ROW * (len(inverses) + len(equations))
    next_state = memory + step.COMPENSATOR_STATE
    rows: list[list[float]] = []
    numbers: list[float] = []
    for one in [*inverses, *forces]:
        effect = one.active.effect
        shared = [float(next_number + len(numbers)), float(next_state)]
        if one.how == INVERSE:
            assert effect.undo is not None and effect.command is not None  # noqa: PT018, S101 - by the plan
            rows.append([float(effect.undo.address), float(effect.command.address), *shared, 0.0, 0.0, 0.0])
        else:
            mass = model.values[f"{one.active.at}.inertia"]
            moves = float(one.active.at in before)
            for equation, dry in ((effect.force, 0.0), (effect.friction, 1.0)):
                if equation is not None:
                    settle = effect.settle.address if effect.settle is not None and not dry else 0
                    rows.append([float(equation.address), float(settle), *shared, mass, moves, dry])
        numbers += [one.values[spec.name] for spec in effect.parameters]
        next_state += effect.states
    # Dry friction last, since that of a loaded contact depends on all other forces of the drive; inverses have 0.
    rows.sort(key=lambda row: row[step.IS_FRICTION])
    flat = [number for row in rows for number in row]
    parameters = np.array([*kernel.parameters, *(float(head[at]) for at in sorted(head)), *flat, *numbers, 0.0])
    parameters[step.COMPENSATION] = start
    state = np.concatenate([kernel.state, np.zeros(next_state - memory + 1)])
    return replace(kernel, parameters=parameters, state=state)
