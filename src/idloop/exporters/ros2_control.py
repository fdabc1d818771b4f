"""ros2_control: parameters of a controller with the model's own gains, limits and joint."""

from __future__ import annotations

from typing import Any

import yaml

from idloop.control import check_controller
from idloop.errors import InputError
from idloop.exporters.exported import (
    Exported,
    acts,
    commented,
    disturbance_left_out,
    effects_left_out,
    file_name,
    quantity,
)
from idloop.physics.model import Model, values_of

PID, FORWARD, TRAJECTORY = "idloop_pid_controller", "idloop_effort_controller", "idloop_trajectory_controller"
IDENTIFIED = "idloop_identified"
# Laws that a PID on one joint can represent.
AS_PID = ("p", "pd", "pid", "cascade")
# Our names of anti-windup methods, and those of control_toolbox.
ANTI_WINDUP = {"back_calculation": "back_calculation", "conditional": "conditional_integration", "none": "none"}
DEFAULT_RATE = 1000  # Hz, without a controller


def _interface(model: Model) -> str:
    """What the drive receives: a force, or the set-point of its loop."""
    return "effort" if model.loop is None else model.loop.effect.name.removesuffix("_loop")


def export(model: Model) -> Exported:
    """Write the parameter file of a controller manager."""
    law = check_controller(model.controller, f"model {model.name}: controller")
    managed: dict[str, Any] = {"update_rate": DEFAULT_RATE}
    if model.controller is not None:
        managed["update_rate"] = max(round(1.0 / law["sample_time"]), 1)
    if model.loop is not None and law["type"] != "none":
        raise InputError(
            f"model {model.name}: its drive has a loop of its own, and a controller around it is not exported: remove"
            " `controller` from the model file"
        )
    managed[FORWARD] = {"type": "forward_command_controller/ForwardCommandController"}
    sections: dict[str, Any] = {FORWARD: {"joints": [model.input.joint], "interface_name": _interface(model)}}
    lost: list[str] = []
    if law["type"] in AS_PID:
        managed[PID] = {"type": "pid_controller/PidController"}
        sections[PID], lost = _pid(model, law)
        if law["output"].endswith(".position"):
            managed[TRAJECTORY] = {"type": "joint_trajectory_controller/JointTrajectoryController"}
            sections[TRAJECTORY] = _trajectory(model, law, sections[PID])
    elif law["type"] != "none":
        lost = [f"controller of type {law['type']}: a PID on one joint has no fields for it"]
    elif _limit(model) is not None:
        lost = [f"limit {_limit(model):.6g} {model.units.input} of the command: {FORWARD} has no field for it"]
    left_out = (*lost, *_plant_left_out(model, law), *disturbance_left_out(model))
    unit = model.units.input
    notes = [
        f"The effort interface takes the model's command, in {unit}"
        + ("." if unit == model.units.force else f"; {quantity(model.parameter('drive.gain'))} make it a force.")
        if model.loop is None
        else f"The {_interface(model)} interface takes the set-point of the drive's own loop, in {model.input.unit}.",
    ]
    if PID in sections:
        closing = f"{PID} or {TRAJECTORY} closes" if TRAJECTORY in sections else f"{PID} closes"
        notes.append(f"Activate one: {closing} the loop, {FORWARD} takes commands; fields of Kilted and later.")
    sections[IDENTIFIED] = _identified(model)
    notes.append(f"No controller reads {IDENTIFIED}: these are the identified parameters, for your own nodes.")
    file = {
        "controller_manager": {"ros__parameters": managed},
        **{name: {"ros__parameters": section} for name, section in sections.items()},
    }
    # PyYAML, as rclpy reads parameter files with it: floats stay floats.
    text = commented(model, "ros2_control parameters", notes, left_out)
    text += yaml.safe_dump(file, sort_keys=False, allow_unicode=True, width=120)
    return Exported("ros2_control", file_name(model.name, ".ros2_control.yaml"), text, left_out)


def _limit(model: Model) -> float | None:
    """Largest command that still has an effect: of the controller, or of the drive."""
    saturations = (a for a in model.effects if a.effect.name == "saturation" and acts(model, a))
    own = (model.controller or {}).get("limit")
    limits = [values_of(active, model.values)["limit"] for active in saturations]
    return min([*limits, *([] if own is None else [float(own)])], default=None)


def _pid(model: Model, law: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a PidController for a law, and the parts of the law that are lost."""
    joint, _, field = law["output"].rpartition(".")
    lost = []
    p, i, d = law["kp"], law.get("ki", 0.0), law.get("kd", 0.0)
    forward = law["velocity_feedforward"]
    on_error = forward == d
    if law["type"] == "cascade":
        # kv e + ki ∫e with e = kp (r - y) + dr/dt - dy/dt is a PID on r - y.
        kp, kv, ki = law["kp"], law["kv"], law["ki"]
        p, i, d = kp * kv + ki, kp * ki, kv
        on_error = forward == 1.0
        if law["velocity_estimate"] != "backward":
            lost.append(f"controller velocity_estimate {law['velocity_estimate']}: ros2_control has its own derivative")
        if law["velocity_limit"] is not None:
            lost.append(f"controller velocity_limit {law['velocity_limit']:.6g}: no field for that of an inner loop")
    if not on_error:
        lost.append(
            f"controller velocity_feedforward {forward:.6g}: ros2_control differentiates the error, "
            "so that the response to a moving reference differs"
        )
    lost += [
        f"controller {key} {law[key]:.6g} s: the derivative of ros2_control is unfiltered"
        for key in ("derivative_filter", "velocity_filter")
        if law.get(key, 0.0) > 0.0
    ]
    if law["linearisation.offset"] != 0.0:
        lost.append(f"controller linearisation.offset {law['linearisation.offset']:.6g}: no field for a constant")
    if law["feedback_gain"] != 1.0:
        lost.append(f"controller feedback_gain {law['feedback_gain']:.6g}: in the gains; divide your reference by it")
    factor = law["feedback_gain"] / law["linearisation.gain"]
    gains: dict[str, Any] = {"p": p * factor, "i": i * factor, "d": d * factor}
    limit = _limit(model)
    if limit is not None:
        gains |= {"u_clamp_max": limit, "u_clamp_min": -limit}
    if i != 0.0:
        gains["antiwindup_strategy"] = ANTI_WINDUP[law["anti_windup"]]
        if law["tracking_time"] is not None:
            gains["tracking_time_constant"] = law["tracking_time"]
    if field == "velocity" and model.values["drive.gain"] != 0.0:
        gains["feedforward_gain"] = _per_velocity(model)
    states = [field]
    if field == "position" and (law.get("velocity_output") or (d != 0.0 and f"{joint}.velocity" in model.output_names)):
        states.append("velocity")
    section: dict[str, Any] = {"dof_names": [model.input.joint]}
    if joint != model.input.joint:
        section["reference_and_state_dof_names"] = [joint]
    section |= {
        "command_interface": "effort",
        "reference_and_state_interfaces": states,
        "gains": {model.input.joint: {key: v if isinstance(v, str) else float(v) for key, v in gains.items()}},
    }
    return section, lost


def _trajectory(model: Model, law: dict[str, Any], pid: dict[str, Any]) -> dict[str, Any]:
    """Parameters of a JointTrajectoryController: those of the PID, and feedforward of the viscous friction."""
    joint = str(law["output"]).rpartition(".")[0]
    (gains,) = pid["gains"].values()
    ahead = {"ff_velocity_scale": _per_velocity(model)} if model.values["drive.gain"] != 0.0 else {}
    command = {} if joint == model.input.joint else {"command_joints": [model.input.joint]}
    return {
        "joints": [joint],
        **command,
        "command_interfaces": ["effort"],
        "state_interfaces": ["position", "velocity"],
        "gains": {joint: {**gains, **ahead}},
    }


def _identified(model: Model) -> dict[str, Any]:
    """Every parameter with its unit, and its 95 % interval where there is one."""
    found: dict[str, Any] = {}
    for parameter in model.parameters:
        entry: dict[str, Any] = {"value": float(parameter.value), "unit": parameter.unit}
        if parameter.interval is not None:
            entry["interval_95"] = [float(end) for end in parameter.interval]
        # Dots separate the levels of ROS parameters.
        place = found
        *above, last = parameter.name.replace("@", ".").split(".")
        for name in above:
            place = place.setdefault(name, {})
        place[last] = entry
    return found


def _per_velocity(model: Model) -> float:
    """Command that holds a velocity against the viscous friction of the whole axis, per unit of velocity."""
    return _viscous(model) / model.values["drive.gain"]


def _viscous(model: Model) -> float:
    """Viscous coefficient of the whole axis, moving as one."""
    extra = [values_of(a, model.values)["coefficient"] for a in model.effects if a.effect.name == "viscous_friction"]
    return sum(extra, sum(model.values[f"{body}.viscous_friction"] for body in model.bodies))


def _plant_left_out(model: Model, law: dict[str, Any]) -> list[str]:
    """Lines for the parts of the plant that a controller has no field for."""
    ahead = law["type"] in AS_PID and model.values["drive.gain"] != 0.0
    lines = [
        f"inertia of {body} {quantity(model.parameter(f'{body}.inertia'))}: no field of a controller"
        for body in model.bodies
    ]
    viscous = f"viscous friction {_viscous(model):.6g} {model.units.fill('{force}·s/{position}')}"
    if not ahead:
        lines.append(f"{viscous}: exported as feedforward of a PID only, and the model has no PID controller")
    lines += [
        f"coupling {name} (stiffness {quantity(model.parameter(f'{name}.stiffness'))}): no field of a controller"
        for name in model.couplings
    ]
    carried = {a.name for a in model.effects if a.effect.name == "viscous_friction" and ahead}
    if law["type"] in (*AS_PID, "none"):
        carried |= {a.name for a in model.effects if a.effect.name == "saturation"}
    return [*lines, *effects_left_out(model, carried)]
