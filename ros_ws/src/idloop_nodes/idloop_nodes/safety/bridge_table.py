"""Parameters of the bridge node; all fixed at the start, so that no service can widen a limit."""

from __future__ import annotations

from idloop_nodes.parameters import NodeParameter, Table
from idloop_nodes.parameters import NodeParameter as P

INTERFACES = ("effort", "velocity", "position")
COMMAND_TYPES = ("float64_multi_array", "float64", "joint_state")
NEUTRALS = ("auto", "zero", "hold_measured", "hold_command")


def bridge_table(*common: NodeParameter) -> Table:
    """Return the table; the common rows are given, because the table of all tables has them."""
    return (*common, *_ROBOT, *_UNITS, *_LIMITS, *_WATCHDOG)


_ROBOT: Table = (
    P("robot_states", "str", "/joint_states", "JointState topic on which the robot measures.", read_only=True),
    P("robot_joints", "strs", ("motor",), "Robot's names of the joints to pass on, the driven first.", read_only=True),
    P("joints", "strs", (), "Our names for them, in the same order; none: the robot's.", read_only=True),
    P(
        "fields",
        "strs",
        ("position", "velocity"),
        "What the robot measures of them: position, velocity, effort; anything else among these than a finite number "
        "stops the motor.",
        read_only=True,
    ),
    P(
        "reliable",
        "bool",
        True,
        "Ask for every measurement; false for a robot that publishes best effort.",
        read_only=True,
    ),
    P(
        "measurement_rate",
        "float",
        2500.0,
        "Largest rate of joint_states: of faster measurements some are left out; the limits see every one.",
        unit="Hz",
        minimum=1.0,
        read_only=True,
    ),
    P(
        "robot_commands",
        "str",
        "/effort_controller/commands",
        "Topic on which the robot takes commands.",
        read_only=True,
    ),
    P("command_type", "str", "float64_multi_array", "Message it takes.", choices=COMMAND_TYPES, read_only=True),
    P(
        "controller_joints",
        "strs",
        (),
        "Joints of a controller that takes several, in its order; the others hold still. None: the driven joint alone.",
        read_only=True,
    ),
    P("interface", "str", "effort", "What the robot is told.", choices=INTERFACES, read_only=True),
    P(
        "neutral",
        "str",
        "auto",
        "Sent where nothing may move: zero, or the position that was measured or commanded last; auto: zero for "
        "effort and velocity, hold_measured for a position.",
        choices=NEUTRALS,
        read_only=True,
    ),
)

_UNITS: Table = (
    P("scale.position", "float", 1.0, "Our unit of position in one of the robot's.", nonzero=True, read_only=True),
    P("offset.position", "float", 0.0, "Our position where the robot measures zero.", read_only=True),
    P(
        "scale.velocity",
        "float",
        None,
        "Our unit of velocity in one of the robot's; not set: scale.position.",
        nonzero=True,
        read_only=True,
    ),
    P("scale.effort", "float", 1.0, "Our unit of effort in one of the robot's.", nonzero=True, read_only=True),
    P("offset.effort", "float", 0.0, "Our effort where the robot measures zero.", read_only=True),
    P(
        "scale.command",
        "float",
        None,
        "Our unit of the command in one of the robot's; not set: that of the measured field of the interface.",
        nonzero=True,
        read_only=True,
    ),
    P(
        "offset.command",
        "float",
        None,
        "Our command where the robot is told zero; not set: that of the measured field of the interface.",
        read_only=True,
    ),
)

_LIMITS: Table = (
    P(
        "limit.command",
        "float",
        None,
        "Must be given: largest absolute command; for a position its largest distance from the measured one.",
        minimum=0.0,
        maximum=1e12,
        read_only=True,
    ),
    P("limit.command_rate", "float", None, "Largest change of the command per second.", minimum=0.0, read_only=True),
    P(
        "limit.rms",
        "float",
        None,
        "Largest rms of the command; beyond, it is scaled back.",
        minimum=0.0,
        read_only=True,
    ),
    P("limit.rms_time", "float", 10.0, "Time constant of that rms.", unit="s", minimum=0.01, read_only=True),
    P("limit.position_min", "float", None, "Below this position the motor is stopped.", read_only=True),
    P("limit.position_max", "float", None, "Above this position the motor is stopped.", read_only=True),
    P("limit.velocity", "float", None, "Beyond this speed the motor is stopped.", minimum=0.0, read_only=True),
    P(
        "limit.coast_time",
        "float",
        0.0,
        "The axis is stopped before a position limit by velocity × this: its time constant when nothing drives it.",
        unit="s",
        minimum=0.0,
        read_only=True,
    ),
    P(
        "limit.energy",
        "float",
        None,
        "Beyond this sum of abs(command × velocity) over time the motor is stopped.",
        minimum=0.0,
        read_only=True,
    ),
    P("limit.energy_time", "float", 10.0, "Time constant of its forgetting.", unit="s", minimum=0.01, read_only=True),
    P(
        "soft_start",
        "float",
        1.0,
        "Time in which the allowed command grows to its limit after every start and stop.",
        unit="s",
        minimum=0.0,
        read_only=True,
    ),
)

_WATCHDOG: Table = (
    P(
        "watchdog",
        "float",
        0.04,
        "Silence of command or measurement after which the motor is stopped.",
        unit="s",
        minimum=1e-3,
        maximum=10.0,
        read_only=True,
    ),
    P(
        "require_guardian",
        "bool",
        True,
        "Drive the motor only while a guardian watches this process: it stops the motor when the bridge dies or hangs.",
        read_only=True,
    ),
    P(
        "allow_other_commanders",
        "bool",
        False,
        "Let commands pass although more than one node publishes joint_command; else the motor is stopped until one "
        "is left.",
        read_only=True,
    ),
    P("latch_watchdog", "bool", False, "What the watchdog found stays until ~/reset.", read_only=True),
)
