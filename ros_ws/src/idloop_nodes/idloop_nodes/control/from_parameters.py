"""Controller and compensation from the parameters of the controller node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from idloop.control import build_controller
from idloop.control.compensation import Compensation
from idloop.errors import InputError
from idloop.parameter_table import read_mapping
from idloop.physics import load_model
from idloop_nodes.streams.joint_layout import output_columns

if TYPE_CHECKING:
    from idloop.control import Controller
    from idloop.physics import Model
    from idloop_nodes.parameters import NodeParameters

COMPENSATION = ("limit", "velocity_width", "command_width", "crossing_time")


def controller_from_parameters(values: NodeParameters, model: Model) -> Controller:
    """Return the controller of the parameter `controller`, else of the model, with its compensation."""
    text = values["controller"]
    section = read_mapping(text, "controller", "{type: pid, kp: 1.0}") if text else model.controller
    specification: dict[str, Any] = {"sample_time": values["sample_time"], **(section or {"type": "none"})}
    return build_controller(specification, compensation=_compensation(values))


def _compensation(values: NodeParameters) -> Compensation | None:
    if not values["compensation"]:
        return None
    numbers = {name: values[f"compensation_{name}"] for name in COMPENSATION}
    return Compensation(load_model(values["compensation"]), tuple(values["compensation_effects"]), **numbers)


def compensated_effects(controller: Controller) -> str:
    """Return the names of the effects that the controller compensates; empty without compensation."""
    return ", ".join(one.active.name for one in controller.plan.cancelled) if controller.plan is not None else ""


def compensation_lines(controller: Controller) -> list[str]:
    """Return lines for the log: what is compensated, and what is not and why."""
    if controller.plan is None:
        return []
    left = controller.plan.left.items()
    return [
        f"cancels {compensated_effects(controller) or 'nothing'}",
        *(f"does not cancel {name}: {reason}" for name, reason in left),
    ]


def controller_columns(controller: Controller, model: Model) -> list[tuple[str, str]]:
    """Return joint and field of each measurement that the controller needs.

    Raises InputError: one of them is no output of the model.
    """
    known = {f"{joint}.{field}": (joint, field) for joint, field in output_columns(model)}
    missing = [name for name in controller.inputs if name not in known]
    if missing:
        raise InputError(f"controller: {missing[0]} is no output of model {model.name} ({', '.join(known)})")
    return [known[name] for name in controller.inputs]
