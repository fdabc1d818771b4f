"""What the node `bridge` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import AUTOSTART, PEERS, START_TIMEOUT
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, flag, number, seconds, text, texts

INTERFACES = ("effort", "velocity", "position")
COMMAND_TYPES = ("float64_multi_array", "float64", "joint_state")
NEUTRALS = ("auto", "zero", "hold_measured", "hold_command")
REQUIRE_GUARDIAN = flag(
    "require_guardian",
    True,
    "Drive the motor only while a guardian watches this process: it stops the motor when the bridge dies or hangs.",
)
LATCH_WATCHDOG = flag("latch_watchdog", False, "What the watchdog found stays until ~/reset.")


PARAMETERS: Table = fixed(
    PEERS,
    START_TIMEOUT,
    AUTOSTART,
    text("robot_states", "/joint_states", "JointState topic on which the robot measures."),
    texts("robot_joints", ("motor",), "Robot's names of the joints to pass on, the driven first."),
    texts("joints", (), "Our names for them, in the same order; none: the robot's."),
    texts(
        "fields",
        ("position", "velocity"),
        "What the robot measures of them: position, velocity, effort; anything else among these than a finite number "
        "stops the motor.",
    ),
    flag("reliable", True, "Ask for every measurement; false for a robot that publishes best effort."),
    number(
        "measurement_rate",
        2500.0,
        "Largest rate of joint_states: of faster measurements some are left out; the limits see every one.",
        unit="Hz",
        minimum=1.0,
    ),
    text("robot_commands", "/effort_controller/commands", "Topic on which the robot takes commands."),
    text("command_type", "float64_multi_array", "Message it takes.", choices=COMMAND_TYPES),
    texts(
        "controller_joints",
        (),
        "Joints of a controller that takes several, in its order; the others hold still. None: the driven joint alone.",
    ),
    text("interface", "effort", "What is commanded.", choices=INTERFACES),
    text(
        "neutral",
        "auto",
        "Sent where nothing may move: zero, or the position that was measured or commanded last; auto: zero for "
        "effort and velocity, hold_measured for a position.",
        choices=NEUTRALS,
    ),
    number("scale.position", 1.0, "Our unit of position in one of the robot's.", nonzero=True),
    number("offset.position", 0.0, "Our position where the robot measures zero."),
    number(
        "scale.velocity", None, "Our unit of velocity in one of the robot's; not set: scale.position.", nonzero=True
    ),
    number("scale.effort", 1.0, "Our unit of effort in one of the robot's.", nonzero=True),
    number("offset.effort", 0.0, "Our effort where the robot measures zero."),
    number(
        "scale.command",
        None,
        "Our unit of the command in one of the robot's; not set: that of the measured field of the interface.",
        nonzero=True,
    ),
    number(
        "offset.command",
        None,
        "Our command where the robot's is zero; not set: that of the measured field of the interface.",
    ),
    number(
        "limit.command",
        None,
        "Must be given: largest absolute command; for a position its largest distance from the measured one.",
        minimum=0.0,
        maximum=1e12,
    ),
    number("limit.command_rate", None, "Largest change of the command per second.", minimum=0.0),
    number("limit.rms", None, "Largest rms of the command; beyond, it is scaled back.", minimum=0.0),
    seconds("limit.rms_time", 10.0, "Time constant of that rms.", minimum=0.01),
    number("limit.position_min", None, "Below this position the motor is stopped."),
    number("limit.position_max", None, "Above this position the motor is stopped."),
    number("limit.velocity", None, "Beyond this speed the motor is stopped.", minimum=0.0),
    seconds(
        "limit.coast_time",
        0.0,
        "The axis is stopped before a position limit by velocity × this: its time constant when nothing drives it.",
    ),
    number(
        "limit.energy", None, "Beyond this sum of abs(command × velocity) over time the motor is stopped.", minimum=0.0
    ),
    seconds("limit.energy_time", 10.0, "Time constant of its forgetting.", minimum=0.01),
    seconds("soft_start", 1.0, "Time in which the allowed command grows to its limit after every start and stop."),
    seconds(
        "watchdog",
        0.04,
        "Silence of command or measurement after which the motor is stopped.",
        minimum=1e-3,
        maximum=10.0,
    ),
    REQUIRE_GUARDIAN,
    flag(
        "allow_other_commanders",
        False,
        "Let commands pass although more than one node publishes joint_command; else the motor is stopped until one "
        "is left.",
    ),
    LATCH_WATCHDOG,
)

DESCRIPTION = NodeDescription(
    about="The last node before the motor: forwards a robot's measurement of a joint to us and our command to the "
    "robot, within limits that no message and no service can widen. Lifecycle node: inactive, after an "
    "emergency stop or a breach of a limit, while a stream is silent, not finite or its clock jumps, and at its"
    " end the motor is stopped. All limits are in our units, and ours = scale × the robot's + offset. [Which "
    "fault ends how soon](how-to/bridge.md).",
    parameters=lambda: PARAMETERS,
    publishes=("joint_states", "bridge/command"),
    subscribes=("joint_command",),
    services={
        "~/emergency_stop": "stop the motor until reset",
        "~/reset": "clear stop and breach, unless the breach still holds, and start softly",
    },
    example="-r __ns:=/axis -p robot_joints:=\"['elbow']\" -p joints:=\"['motor']\" -p limit.command:=2.0",
)
