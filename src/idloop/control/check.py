"""Validation of the `controller:` section of a model file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from idloop.control.catalogue import CONTROLLERS
from idloop.errors import InputError
from idloop.parameter_table import check_values
from idloop.spelling import did_you_mean

FIELDS = ("position", "velocity", "effort")


def check_controller(spec: Mapping[str, Any] | None, where: str = "controller") -> dict[str, Any]:
    """Validate a controller section without building the controller.

    Parameters
    ----------
    spec : mapping or None
        The section; None stands for ``{type: none}``. Groups may be nested or dotted.
    where : str
        Place named at the start of the error line.

    Returns
    -------
    dict
        ``type`` and every parameter of the type by its dotted name, defaults filled in.

    Raises
    ------
    InputError
        Unknown type or key, wrong type, out of range, or keys that contradict each other.
    """
    if spec is None:
        spec = {"type": "none"}
    if not isinstance(spec, Mapping):
        raise InputError(
            f"{where}: must be a mapping with a type, got {type(spec).__name__}; "
            "for example {type: p, output: motor.position, kp: 1.0, sample_time: 0.001}"
        )
    given = dict(spec)
    if "type" not in given:
        raise InputError(f"{where}: type is missing; choose one of {', '.join(CONTROLLERS)}")
    kind = given.pop("type")
    if not isinstance(kind, str) or kind not in CONTROLLERS:
        raise InputError(
            f"{where}: unknown type {kind!r}{did_you_mean(str(kind), CONTROLLERS)}; "
            f"choose one of {', '.join(CONTROLLERS)}"
        )
    here = f"{where} {kind}"
    values = check_values(CONTROLLERS[kind].parameters, given, here)
    _check_outputs(kind, values, here)
    if kind == "state_feedback":
        _check_state_feedback(values, here)
    return {"type": kind, **values}


def joint_and_field(name: str, key: str, where: str) -> tuple[str, str]:
    """Split ``joint.field``; the joint's name may itself hold dots."""
    joint, _, field = name.rpartition(".")
    if not joint or field not in FIELDS:
        raise InputError(
            f"{where}: {key} is {name!r} but must be joint.field with field one of "
            f"{', '.join(FIELDS)}, such as motor.position"
        )
    return joint, field


def controller_inputs(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Outputs that a checked controller reads, in the order of its measurement array."""
    kind = values["type"]
    if kind == "none":
        return ()
    if kind == "state_feedback":
        return tuple(name for name in values["states"] if name not in values["differentiate"])
    if kind == "cascade" and values["velocity_output"] is not None:
        return values["output"], values["velocity_output"]
    return (values["output"],)


def _check_outputs(kind: str, values: Mapping[str, Any], where: str) -> None:
    if "output" in values:
        _, field = joint_and_field(values["output"], "output", where)
        if kind == "cascade" and field != "position":
            raise InputError(f"{where}: output is {values['output']!r} but a cascade controls a position")
    velocity = values.get("velocity_output")
    if velocity is not None and joint_and_field(velocity, "velocity_output", where)[1] != "velocity":
        raise InputError(
            f"{where}: velocity_output is {velocity!r} but must name a velocity; leave it out to "
            "estimate the velocity from the position"
        )


def _check_state_feedback(values: Mapping[str, Any], where: str) -> None:
    states = values["states"]
    if not states:
        raise InputError(f"{where}: states is empty; list at least one, such as motor.position")
    for name in states:
        joint_and_field(name, "states", where)
        if states.count(name) > 1:
            raise InputError(f"{where}: {name} stands twice in states; list each state once")
    for name in values["differentiate"]:
        joint, field = joint_and_field(name, "differentiate", where)
        if name not in states or field != "velocity" or f"{joint}.position" not in states:
            raise InputError(
                f"{where}: differentiate holds {name!r}; it must be a velocity in states whose "
                "joint's position is in states too"
            )
    design = [key for key in ("q", "r", "model.a", "model.b") if values[key] is not None]
    if values["gains"] is not None:
        if design:
            raise InputError(f"{where}: both gains and {design[0]} are given; give either gains or a design")
        _check_length(values["gains"], "gains", states, where)
        return
    if len(design) < 4:
        missing = [key for key in ("q", "r", "model.a", "model.b") if key not in design]
        raise InputError(
            f"{where}: {', '.join(missing)} missing; give gains, or q, r, model.a and model.b for a design"
        )
    _check_length(values["q"], "q", states, where)
    _check_length(values["model.b"], "model.b", states, where)
    _check_length(values["model.a"], "model.a", states, where)
    _check_length(values["model.a"][0], "each row of model.a", states, where)


def _check_length(value: tuple[Any, ...], name: str, states: tuple[str, ...], where: str) -> None:
    if len(value) != len(states):
        raise InputError(f"{where}: {name} has {len(value)} entries but there are {len(states)} states")
