"""Every controller type with the table of its parameters."""

from __future__ import annotations

from dataclasses import dataclass

from idloop.parameter_table import REQUIRED, ParameterSpec


@dataclass(frozen=True)
class ControllerKind:
    """A controller type.

    Parameters
    ----------
    name : str
        Name used in model files.
    description : str
        One sentence.
    law : str
        Its equation in plain text.
    parameters : tuple of ParameterSpec
        Every key that its section of a model file may hold, besides ``type``.
    """

    name: str
    description: str
    law: str
    parameters: tuple[ParameterSpec, ...]


_SAMPLE_TIME = ParameterSpec(
    "sample_time",
    "float",
    REQUIRED,
    "Period of the controller.",
    unit="s",
    minimum=0.0,
    exclusive=True,
)
_OUTPUT_STAGE = (
    ParameterSpec(
        "limit",
        "float",
        None,
        "Largest absolute command; left out, none.",
        unit="u",
        minimum=0.0,
        exclusive=True,
    ),
    ParameterSpec(
        "linearisation.gain",
        "float",
        1.0,
        "Gain of the input model that is inverted: u = (law - offset) / gain.",
        nonzero=True,
    ),
    ParameterSpec("linearisation.offset", "float", 0.0, "Offset of the input model that is inverted."),
)
_FEEDBACK_GAIN = ParameterSpec("feedback_gain", "float", 1.0, "Factor on every measured output before it is compared.")
_COMMON = (_SAMPLE_TIME, *_OUTPUT_STAGE, _FEEDBACK_GAIN)
_OUTPUT = ParameterSpec(
    "output", "str", REQUIRED, "Measured output to control, as joint.field, such as motor.position."
)
_POSITION = ParameterSpec(
    "output",
    "str",
    REQUIRED,
    "Measured position to control, as joint.field, such as load.position.",
)
_KP = ParameterSpec("kp", "float", REQUIRED, "Proportional gain.", unit="u/y")
_KD = ParameterSpec("kd", "float", REQUIRED, "Derivative gain, on the output only.", unit="u s/y")
_DERIVATIVE_FILTER = ParameterSpec(
    "derivative_filter",
    "float",
    0.0,
    "Time constant of the low-pass on the derivative; 0 for none.",
    unit="s",
    minimum=0.0,
)
_VELOCITY_FEEDFORWARD = ParameterSpec(
    "velocity_feedforward",
    "float",
    0.0,
    "Gain on the reference velocity; equal to kd it puts the derivative on the error.",
    unit="u s/y",
)
_ANTI_WINDUP = (
    ParameterSpec(
        "anti_windup",
        "str",
        "back_calculation",
        "What keeps the integral from growing while the command is limited.",
        choices=("back_calculation", "conditional", "none"),
    ),
    ParameterSpec(
        "tracking_time",
        "float",
        None,
        "Time constant of back calculation; left out, chosen from the gains.",
        unit="s",
        minimum=0.0,
        exclusive=True,
    ),
)

CONTROLLERS: dict[str, ControllerKind] = {
    kind.name: kind
    for kind in (
        ControllerKind(
            "none",
            "No feedback: the excitation alone, linearised and limited.",
            "law = feedforward",
            (
                ParameterSpec(
                    "sample_time",
                    "float",
                    0.001,
                    "Period of the controller.",
                    unit="s",
                    minimum=0.0,
                    exclusive=True,
                ),
                *_OUTPUT_STAGE,
            ),
        ),
        ControllerKind(
            "p",
            "Proportional controller.",
            "law = kp (r - y)",
            (_OUTPUT, _KP, _VELOCITY_FEEDFORWARD, *_COMMON),
        ),
        ControllerKind(
            "pd",
            "Proportional controller with the derivative on the output only.",
            "law = kp (r - y) - kd dy/dt",
            (_OUTPUT, _KP, _KD, _DERIVATIVE_FILTER, _VELOCITY_FEEDFORWARD, *_COMMON),
        ),
        ControllerKind(
            "pid",
            "PID controller with the derivative on the output only.",
            "law = kp (r - y) + ki ∫(r - y) dt - kd dy/dt",
            (
                _OUTPUT,
                _KP,
                ParameterSpec("ki", "float", REQUIRED, "Integral gain.", unit="u/(y s)"),
                ParameterSpec("kd", "float", 0.0, "Derivative gain, on the output only.", unit="u s/y"),
                _DERIVATIVE_FILTER,
                _VELOCITY_FEEDFORWARD,
                *_ANTI_WINDUP,
                *_COMMON,
            ),
        ),
        ControllerKind(
            "lead",
            "Lead (zero below pole) or lag compensator on the error, discretised by Tustin.",
            "law = gain (s + zero) / (s + pole) (r - y)",
            (
                _OUTPUT,
                ParameterSpec("gain", "float", REQUIRED, "Gain at high frequency.", unit="u/y"),
                ParameterSpec("zero", "float", REQUIRED, "Zero at s = -zero.", unit="rad/s", minimum=0.0),
                ParameterSpec(
                    "pole",
                    "float",
                    REQUIRED,
                    "Pole at s = -pole.",
                    unit="rad/s",
                    minimum=0.0,
                    exclusive=True,
                ),
                *_COMMON,
            ),
        ),
        ControllerKind(
            "cascade",
            "Position P around velocity P or PI.",
            "law = kv e + ki ∫e dt, e = kp (r - y) + velocity_feedforward dr/dt - v",
            (
                _POSITION,
                ParameterSpec(
                    "velocity_output",
                    "str",
                    None,
                    "Measured velocity, as joint.field; left out, estimated from the position.",
                ),
                ParameterSpec("kp", "float", REQUIRED, "Gain of the position loop.", unit="1/s"),
                ParameterSpec("kv", "float", REQUIRED, "Gain of the velocity loop.", unit="u s/y"),
                ParameterSpec("ki", "float", 0.0, "Integral gain of the velocity loop.", unit="u/y"),
                ParameterSpec(
                    "velocity_feedforward",
                    "float",
                    0.0,
                    "Share of the reference velocity in the velocity loop's reference.",
                ),
                ParameterSpec(
                    "velocity_limit",
                    "float",
                    None,
                    "Largest absolute reference of the velocity loop; left out, none.",
                    unit="y/s",
                    minimum=0.0,
                    exclusive=True,
                ),
                ParameterSpec(
                    "velocity_estimate",
                    "str",
                    "backward",
                    "Velocity from positions: backward difference of samples, or of means of two.",
                    choices=("backward", "mean"),
                ),
                ParameterSpec(
                    "velocity_filter",
                    "float",
                    0.0,
                    "Time constant of the low-pass on the velocity; 0 for none.",
                    unit="s",
                    minimum=0.0,
                ),
                *_ANTI_WINDUP,
                *_COMMON,
            ),
        ),
        ControllerKind(
            "state_feedback",
            "State feedback with given gains, or with those of a linear-quadratic design.",
            "law = Σ gain_i (reference_i - x_i); positions follow r, velocities dr/dt, others 0",
            (
                ParameterSpec("states", "strs", REQUIRED, "States in order, each as joint.field."),
                ParameterSpec(
                    "differentiate",
                    "strs",
                    (),
                    "Velocity states that are differentiated from the same joint's position.",
                ),
                _DERIVATIVE_FILTER,
                ParameterSpec("gains", "floats", None, "One gain per state; or give q, r and model."),
                ParameterSpec("q", "floats", None, "Weight of each state squared.", minimum=0.0),
                ParameterSpec(
                    "r",
                    "float",
                    None,
                    "Weight of the command squared.",
                    minimum=0.0,
                    exclusive=True,
                ),
                ParameterSpec("model.a", "matrix", None, "A of dx/dt = A x + B law, states in the same order."),
                ParameterSpec("model.b", "floats", None, "B, one number per state."),
                ParameterSpec(
                    "design",
                    "str",
                    "discrete",
                    "Design for the model sampled at sample_time, or for the continuous one.",
                    choices=("discrete", "continuous"),
                ),
                *_COMMON,
            ),
        ),
    )
}
