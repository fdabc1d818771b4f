"""Flat arrays of the compiled step for a compensation plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from idloop.control import step
from idloop.control.compensation import (
    FORCE,
    INVERSE,
    SHIFT,
    Cancelled,
    Plan,
    followed_output,
)
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
    head = [0.0] * step.COMPENSATOR_HEAD
    head[step.MEMORY] = memory
    head[step.MOST] = settings.limit
    head[step.COMMAND_WIDTH] = settings.command_width
    head[step.VELOCITY_WIDTH] = settings.velocity_width
    head[step.PER_REFERENCE] = 1.0 if followed is None else 1.0 / (values.get("feedback_gain", 1.0) * followed.scale)
    head[step.GIVES_VELOCITY] = float(followed is not None and followed.field == "velocity")
    head[step.DRIVE_GAIN] = model.values["drive.gain"]
    head[step.GAP] = lost
    head[step.GAP_SHIFTS] = float(bool(plan.of(SHIFT)))
    head[step.GAP_INERTIA], head[step.GAP_VISCOUS] = inertia, viscous
    head[step.CROSSING_TIME] = settings.crossing_time
    next_number = start + len(head) + step.ROW * (len(inverses) + len(forces) + sum(map(_has_both, forces)))
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
    # Dry friction last, since that of a loaded contact depends on all other forces of the drive.
    inverse_rows, force_rows = (
        rows[: len(inverses)],
        sorted(rows[len(inverses) :], key=lambda row: row[step.IS_FRICTION]),
    )
    head[step.INVERSES], head[step.FORCES] = float(len(inverse_rows)), float(len(force_rows))
    flat = [number for row in [*inverse_rows, *force_rows] for number in row]
    parameters = np.array([*kernel.parameters, *head, *flat, *numbers, 0.0])
    parameters[step.COMPENSATION] = start
    state = np.concatenate([kernel.state, np.zeros(next_state - memory + 1)])
    return replace(kernel, parameters=parameters, state=state)


def _has_both(one: Cancelled) -> bool:
    return one.active.effect.force is not None and one.active.effect.friction is not None
