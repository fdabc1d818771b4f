"""The `controller:` section of a model file: every controller type with its parameters, and their validation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from idloop.errors import InputError
from idloop.parameter_table import REQUIRED, ParameterSpec, check_values, positive
from idloop.spelling import did_you_mean

FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class ControllerKind:
    """A controller type."""

    name: str  # name used in model files
    description: str  # one sentence
    law: str  # its equation in plain text
    parameters: tuple[ParameterSpec, ...]  # every key that its section of a model file may hold, besides ``type``


def _number(name: str, default: Any, description: str, unit: str = "", **limits: Any) -> ParameterSpec:
    return ParameterSpec(name, "float", default, description, unit, **limits)


def _text(name: str, default: Any, description: str, *choices: str) -> ParameterSpec:
    return ParameterSpec(name, "str", default, description, choices=choices)


_OUTPUT_STAGE = (
    positive("limit", None, "Largest absolute command; left out, none.", "u"),
    _number(
        "linearisation.gain", 1.0, "Gain of the input model that is inverted: u = (law - offset) / gain.", nonzero=True
    ),
    _number("linearisation.offset", 0.0, "Offset of the input model that is inverted."),
)
_FEEDBACK_GAIN = _number("feedback_gain", 1.0, "Factor on every measured output before it is compared.")
_COMMON = (positive("sample_time", REQUIRED, "Period of the controller.", "s"), *_OUTPUT_STAGE, _FEEDBACK_GAIN)
_OUTPUT = _text("output", REQUIRED, "Measured output to control, as joint.field, such as motor.position.")
_POSITION = _text("output", REQUIRED, "Measured position to control, as joint.field, such as load.position.")
_KP = _number("kp", REQUIRED, "Proportional gain.", "u/y")
_DERIVATIVE_FILTER = _number(
    "derivative_filter", 0.0, "Time constant of the low-pass on the derivative; 0 for none.", "s", minimum=0.0
)
_VELOCITY_FEEDFORWARD = _number(
    "velocity_feedforward", 0.0, "Gain on the reference velocity; equal to kd it puts the derivative on the error.",
    "u s/y",
)  # fmt: skip
_ANTI_WINDUP = (
    _text(
        "anti_windup", "back_calculation", "What keeps the integral from growing while the command is limited.",
        "back_calculation", "conditional", "none",
    ),
    positive("tracking_time", None, "Time constant of back calculation; left out, chosen from the gains.", "s"),
)  # fmt: skip
_DERIVATIVE = "Derivative gain, on the output only."


def _feedback(name: str, description: str, law: str, *parameters: ParameterSpec) -> ControllerKind:
    return ControllerKind(name, description, law, (*parameters, *_COMMON))


_KINDS = (
    ControllerKind(
        "none",
        "No feedback: the excitation alone, linearised and limited.",
        "law = feedforward",
        (positive("sample_time", 0.001, "Period of the controller.", "s"), *_OUTPUT_STAGE),
    ),
    _feedback("p", "Proportional controller.", "law = kp (r - y)", _OUTPUT, _KP, _VELOCITY_FEEDFORWARD),
    _feedback(
        "pd",
        "Proportional controller with the derivative on the output only.",
        "law = kp (r - y) - kd dy/dt",
        _OUTPUT,
        _KP,
        _number("kd", REQUIRED, _DERIVATIVE, "u s/y"),
        _DERIVATIVE_FILTER,
        _VELOCITY_FEEDFORWARD,
    ),
    _feedback(
        "pid",
        "PID controller with the derivative on the output only.",
        "law = kp (r - y) + ki ∫(r - y) dt - kd dy/dt",
        _OUTPUT,
        _KP,
        _number("ki", REQUIRED, "Integral gain.", "u/(y s)"),
        _number("kd", 0.0, _DERIVATIVE, "u s/y"),
        _DERIVATIVE_FILTER,
        _VELOCITY_FEEDFORWARD,
        *_ANTI_WINDUP,
    ),
    _feedback(
        "lead",
        "Lead (zero below pole) or lag compensator on the error, discretised by Tustin.",
        "law = gain (s + zero) / (s + pole) (r - y)",
        _OUTPUT,
        _number("gain", REQUIRED, "Gain at high frequency.", "u/y"),
        _number("zero", REQUIRED, "Zero at s = -zero.", "rad/s", minimum=0.0),
        positive("pole", REQUIRED, "Pole at s = -pole.", "rad/s"),
    ),
    _feedback(
        "cascade",
        "Position P around velocity P or PI.",
        "law = kv e + ki ∫e dt, e = kp (r - y) + velocity_feedforward dr/dt - v",
        _POSITION,
        _text("velocity_output", None, "Measured velocity, as joint.field; left out, estimated from the position."),
        _number("kp", REQUIRED, "Gain of the position loop.", "1/s"),
        _number("kv", REQUIRED, "Gain of the velocity loop.", "u s/y"),
        _number("ki", 0.0, "Integral gain of the velocity loop.", "u/y"),
        _number("velocity_feedforward", 0.0, "Share of the reference velocity in the velocity loop's reference."),
        positive("velocity_limit", None, "Largest absolute reference of the velocity loop; left out, none.", "y/s"),
        _text(
            "velocity_estimate",
            "backward",
            "Velocity from positions: backward difference of samples, or of means of two.",
            *("backward", "mean"),
        ),
        _number("velocity_filter", 0.0, "Time constant of the low-pass on the velocity; 0 for none.", "s", minimum=0.0),
        *_ANTI_WINDUP,
    ),
    _feedback(
        "state_feedback",
        "State feedback with given gains, or with those of a linear-quadratic design.",
        "law = Σ gain_i (reference_i - x_i); positions follow r, velocities dr/dt, others 0",
        ParameterSpec("states", "strs", REQUIRED, "States in order, each as joint.field."),
        ParameterSpec(
            "differentiate", "strs", (), "Velocity states that are differentiated from the same joint's position."
        ),
        _DERIVATIVE_FILTER,
        ParameterSpec("gains", "floats", None, "One gain per state; or give q, r and model."),
        ParameterSpec("q", "floats", None, "Weight of each state squared.", minimum=0.0),
        positive("r", None, "Weight of the command squared."),
        ParameterSpec("model.a", "matrix", None, "A of dx/dt = A x + B law, states in the same order."),
        ParameterSpec("model.b", "floats", None, "B, one number per state."),
        _text(
            "design",
            "discrete",
            "Design for the model sampled at sample_time, or for the continuous one.",
            *("discrete", "continuous"),
        ),
    ),
)
CONTROLLERS: dict[str, ControllerKind] = {kind.name: kind for kind in _KINDS}


def check_controller(spec: Mapping[str, Any] | None, where: str = "controller") -> dict[str, Any]:
    """Validate a controller section without building the controller.

    `spec`: the section; None stands for ``{type: none}``. Groups may be nested or dotted. `where`: place named at the
    start of the error line. Returns ``type`` and every parameter of the type by its dotted name, defaults filled in.
    Raises InputError: unknown type or key, wrong type, out of range, or keys that contradict each other.
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
            raise InputError(f"{where}: states contains {name} twice; list each state once")
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
