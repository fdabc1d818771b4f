"""The six-joint arm of `six_joint_arm/` as a robot on ROS 2, in real time: a stand-in for yours.

It publishes `/joint_states` and follows what comes on `/joint_trajectory_controller/joint_trajectory`. The drives hide
the effects of `record_arm.py`.

    python benchmarks/arm_robot.py                      # until Ctrl-C
    python benchmarks/arm_robot.py --payload 1.3 --log set_points.csv
"""

from __future__ import annotations

import argparse
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

import numpy as np
import rclpy
from arm_machine import JOINTS, Machine, Simulation
from numpy.typing import NDArray
from record_arm import CONTROL, HIDDEN, PLACE
from sensor_msgs.msg import JointState
from trajectory_follower import Follower
from trajectory_msgs.msg import JointTrajectory

from idloop.ending_signals import ending_signals
from idloop_nodes import qos
from idloop_nodes.codec import JointWriter, decode_trajectory
from idloop_nodes.codec.joints import FIELDS
from idloop_nodes.middleware import use_sockets_only
from idloop_nodes.runtime import make_executor
from idloop_nodes.timing import become_urgent

Array = NDArray[np.float64]

SECOND = 1_000_000_000
EACH = 2  # control steps for each measurement


class Arm:
    """The arm and its topics."""

    def __init__(self, machine: Machine, start: Array, seed: int, log: TextIO | None) -> None:
        self._simulation = Simulation(machine, start, np.zeros(len(JOINTS)), seed)
        self._follower = Follower(JOINTS, start)
        self._writer = JointWriter(JOINTS, FIELDS)
        self._log = log
        self._efforts: list[Array] = []
        self.node = rclpy.create_node("arm_robot")
        self._states = self.node.create_publisher(JointState, "/joint_states", qos.stream(100))
        self.node.create_subscription(
            JointTrajectory, "/joint_trajectory_controller/joint_trajectory", self._take, qos.stream(10), raw=True
        )

    def _take(self, data: bytes) -> None:
        self._follower.take(time.time_ns(), *decode_trajectory(data))

    def advance(self, now_ns: int, count: int) -> None:
        """Go so many control steps, of which the last one ends at an instant; publish what is due."""
        for k in range(count):
            stamp = now_ns - (count - 1 - k) * round(CONTROL * SECOND)
            told = self._follower.at(stamp)
            position, velocity, effort = self._simulation.follow(*told)
            if stamp // round(CONTROL * SECOND) % EACH == 0:
                self._states.publish(self._writer.pack(stamp, position, velocity, self._simulation.sensed(effort)))
                self._write(told, position, velocity)

    def _write(self, told: tuple[Array, Array], position: Array, velocity: Array) -> None:
        if self._log is not None:
            row = [time.monotonic_ns(), self._follower.refused, *told[0], *told[1], *position, *velocity]
            self._log.write(
                ",".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in row) + "\n"
            )
            self._log.flush()


def main() -> None:
    """Run until a signal."""
    import signal
    import threading

    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--payload", type=float, default=0.0, help="mass at the last link [kg]")
    parser.add_argument("--start", type=float, nargs=6, default=[0.0] * 6, help="position at first [rad]")
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    parser.add_argument("--log", type=Path, help="CSV of set-points and motion, by the steady clock")
    given = parser.parse_args()
    become_urgent()
    use_sockets_only()
    ended = threading.Event()
    for number in ending_signals():
        signal.signal(number, lambda *_: ended.set())
    with ExitStack() as stack:
        log = stack.enter_context(given.log.open("w", encoding="utf-8")) if given.log else None
        rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        payload = (given.payload, PLACE) if given.payload else None
        arm = Arm(Machine(HIDDEN, payload), np.array(given.start), given.seed, log)
        executor = make_executor()
        executor.add_node(arm.node)
        step = round(CONTROL * SECOND)
        done = time.time_ns() // step
        while not ended.is_set():
            executor.spin_once(timeout_sec=EACH * CONTROL)
            due = time.time_ns() // step
            arm.advance(due * step, due - done)
            done = due


if __name__ == "__main__":
    main()
