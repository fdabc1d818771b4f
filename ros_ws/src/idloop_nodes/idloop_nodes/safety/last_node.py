"""What the last two processes before a motor share, the bridge and its guardian: period and priority."""

from __future__ import annotations

import gc
import signal

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from idloop_nodes.deadlines import become_urgent

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
