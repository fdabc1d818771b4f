"""A compensator as a model file for the controller node, with only the effects that it cancels."""

from __future__ import annotations

import math
from dataclasses import replace

from idloop.control.compensation import Compensation, plan_compensation
from idloop.control.compensation_settings import choose_settings
from idloop.errors import InputError
from idloop.exporters.exported import Exported, commented, file_name
from idloop.physics.controller_section import check_controller
from idloop.physics.model import Model

NOTES = (
    "Controller node: parameters model and compensation, both the path of this file.",
    "idloop compensate shows the improvement.",
)


def export(model: Model) -> Exported:
    """Write the compensator of the model's own controller.

    `model`: the machine as a fit has found it. Raises InputError: the model has no controller.
    """
    if model.controller is None:
        raise InputError(f"model {model.name} has no controller: add one to its file")
    return export_compensation(Compensation(model))


def export_compensation(compensation: Compensation) -> Exported:
    """Write a compensation whose model has a controller. Raises InputError: an effect cannot be cancelled."""
    model = compensation.model
    values = check_controller(model.controller)
    plan = plan_compensation(compensation, values)
    settings = choose_settings(compensation, plan, values)
    inside = {one.active.at for one in plan.cancelled}
    needed = {active.name for at, active in model.inner_couplings.items() if at in inside}
    kept = model.without_effects(name for name in plan.left if name not in needed)
    numbers = [f"compensation_{key}: {value:.6g}" for key, value in vars(settings).items() if 0.0 < value < math.inf]
    left_out = tuple(f"{name}: {reason}" for name, reason in plan.left.items())
    notes = (*NOTES, "Without other parameters the node works with:", *numbers)
    text = commented(model, "Compensator", notes, left_out) + replace(kept, folder=None).to_yaml()
    return Exported("compensator", file_name(model.name, ".compensator.yaml"), text, left_out)
