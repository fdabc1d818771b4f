"""What the node `trajectory_bridge` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.bridge import LATCH_WATCHDOG, REQUIRE_GUARDIAN
from idloop_nodes.descriptions.common import AUTOSTART, PEERS, RELIABLE, START_TIMEOUT
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, flag, number, seconds, text

PARAMETERS: Table = fixed(
    PEERS,
    START_TIMEOUT,
    AUTOSTART,
    text("trajectory", "", "Must be given: file of `idloop robot excite`, .yaml or .csv."),
    text("urdf", "", "Must be given: description of the robot; its limits of position, velocity and effort hold."),
    text("robot_states", "/joint_states", "JointState topic on which the robot measures all of the joints."),
    RELIABLE,
    text(
        "robot_commands",
        "/joint_trajectory_controller/joint_trajectory",
        "Topic on which the robot takes trajectories.",
    ),
    number(
        "limit.acceleration",
        None,
        "Must be given: largest acceleration of every joint, stops included.",
        unit="rad/s^2 or m/s^2",
        minimum=0.0,
        exclusive=True,
    ),
    number(
        "limit.following_error",
        0.2,
        "Largest distance of a measured position from the planned one; beyond, the arm is stopped.",
        unit="rad or m",
        minimum=0.0,
        exclusive=True,
    ),
    number(
        "approach",
        0.05,
        "Largest distance of a joint from the beginning of the trajectory from which the arm is brought there, in a "
        "straight line in joint space that is not checked for collisions.",
        unit="rad or m",
        minimum=0.0,
    ),
    seconds(
        "stop_time",
        0.5,
        "Time in which the arm comes to rest on its path from full speed, and starts softly.",
        minimum=0.05,
        maximum=5.0,
    ),
    seconds(
        "horizon",
        0.1,
        "Time for which the robot goes on by itself before it slows down, when nothing more comes.",
        minimum=0.04,
        maximum=1.0,
    ),
    seconds("watchdog", 0.1, "Silence of the measurement after which the arm is stopped.", minimum=1e-3, maximum=10.0),
    REQUIRE_GUARDIAN,
    LATCH_WATCHDOG,
    flag(
        "end_when_done", True, "End the node, and a graph that ends with it, when the trajectory has come to its end."
    ),
)

DESCRIPTION = NodeDescription(
    about="Lets an arm follow a planned trajectory through its joint_trajectory_controller. The trajectory is checked "
    "before anything moves, against the limits of the URDF and so that it can be stopped anywhere on its path; it is "
    "sent in pieces of which each ends at rest. Lifecycle node: inactive, after an emergency stop or a breach of a "
    "limit, while the measurement is silent, not finite or its clock jumps, and at its end the arm comes to rest "
    "within `stop_time`. [Which fault ends how soon](how-to/bridge.md#an-arm).",
    parameters=lambda: PARAMETERS,
    publishes=("bridge/command",),
    services={
        "~/emergency_stop": "stop the arm until reset",
        "~/reset": "clear stop and breach, unless the breach still holds, and go on softly along the path",
    },
    example="-r __ns:=/arm -p trajectory:=trajectory.yaml -p urdf:=arm.urdf -p limit.acceleration:=12.0",
)
