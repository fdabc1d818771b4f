"""What the last two processes before a motor share, the bridge and its guardian, and who else commands the motor."""

from __future__ import annotations

import gc
import signal
from collections.abc import Collection
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from idloop.errors import InputError
from idloop_nodes.codec.diagnostics import absolute_name
from idloop_nodes.timing import become_urgent

PRIORITY = 40  # above that of the other nodes' loops, 20
TICK = 0.005  # seconds between checks of the watchdog, and between two beats
TRAJECTORY = "joint_trajectory"
MESSAGES = {
    "float64_multi_array": Float64MultiArray,
    "float64": Float64,
    "joint_state": JointState,
    TRAJECTORY: JointTrajectory,
}


def prepare() -> None:
    """Keep other processes, a busy machine and the terminal from delaying the watchdog of this process.

    Every thread becomes urgent, for the watchdog needs the interpreter, and the others hold it now and then. What has
    been imported is taken from the garbage collector, which would stop everything to search it. Ctrl-Z ends the
    process instead of stopping it: a stopped one would leave the motor with its last command.
    """
    become_urgent(PRIORITY)
    gc.collect()
    gc.freeze()
    signal.signal(signal.SIGTSTP, signal.getsignal(signal.SIGTERM))
    for number in (signal.SIGTTIN, signal.SIGTTOU):
        signal.signal(number, signal.SIG_IGN)


def refuse_loops(node: Any) -> None:
    """Refuse topics of the robot that are the bridge's own: it would read or forward its own messages."""
    for parameter, ours in (("robot_states", "joint_states"), ("robot_commands", "joint_command")):
        topic = node.resolve_topic_name(node.parameters[parameter])
        if topic == node.resolve_topic_name(ours):
            raise InputError(
                f"bridge: {parameter} is {topic}, which is our own {ours}; start the graph in a namespace "
                "(-r __ns:=/axis) or give the robot's topic another name"
            )


def competing_publishers(node: Any, topic: str, known: Collection[str]) -> str:
    """Return why the motor must not be driven: others than the `known` nodes publish to the robot, past all limits."""
    publishers = [_name(one) for one in node.get_publishers_info_by_topic(topic)]
    others = {one for one in publishers if one not in known or publishers.count(one) > 1}
    return f"others publish on {topic}, past all limits: {', '.join(sorted(others))}" if others else ""


def several_commanders(node: Any, count: int) -> str:
    """Return why no command may pass because several nodes publish `joint_command`; else empty."""
    if count <= 1:
        return ""
    names = ", ".join(sorted(_name(one) for one in node.get_publishers_info_by_topic("joint_command")))
    return f"{count} nodes publish joint_command ({names}): end all but one, or set allow_other_commanders"


def _name(endpoint: Any) -> str:
    return absolute_name(endpoint.node_namespace, endpoint.node_name)
