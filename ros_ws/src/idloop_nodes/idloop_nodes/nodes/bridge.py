"""The bridge: between our topics and a robot's, the last node before its motor."""

from __future__ import annotations

import time

from sensor_msgs.msg import JointState

from idloop_nodes import qos
from idloop_nodes.codec import CdrError, JointReader, JointWriter, Status
from idloop_nodes.safety.guarded_node import GuardedNode
from idloop_nodes.safety.last_node import prepare, refuse_loops, several_commanders
from idloop_nodes.safety.robot_joints import RobotJoints
from idloop_nodes.safety.safety_gate import SafetyGate, gate_settings
from idloop_nodes.streams.rates import Decimator

__all__ = ["BridgeNode", "make", "prepare"]


class BridgeNode(GuardedNode[float]):
    """Forwards a robot's messages to us and ours to the robot on arrival, through a `SafetyGate`."""

    _gate: SafetyGate

    def __init__(self) -> None:
        super().__init__("bridge")
        values = self.parameters
        self._robot = RobotJoints(values.values)
        self._gate = SafetyGate(gate_settings(values.values))
        refuse_loops(self)
        self._command_reader = JointReader([(self._robot.names[0], "effort")])
        self._sent_writer = JointWriter(self._robot.names[:1], ["effort"])
        self._decimator = Decimator(values["measurement_rate"])
        self._publish_states = self.publisher("joint_states")
        profile = qos.stream(reliable=values["reliable"])
        self.subscribe(JointState, values["robot_states"], self._on_measurement, profile)
        # Only the newest command counts: a bridge that was held up must not play back what has passed.
        self.subscriptions_by_topic["joint_command"] = self.subscribe(
            JointState,
            "joint_command",
            self._on_command,
            qos.stream(1),
            # Known before the first command of the newcomer.
            matched=lambda info: self._check_commanders(),
        )
        self.guard(self._gate, values["command_type"])

    # streams

    def _on_measurement(self, data: bytes) -> None:
        wall = time.time_ns()
        try:
            read = self._robot.read(data)
        except CdrError:
            self.counters.unreadable += 1
            return
        if read is None:
            return
        stamp, values = read
        robot = self._robot
        position, velocity = robot.measured(values, "position"), robot.measured(values, "velocity")
        with self._lock:
            self._robot_clock.update(stamp, wall)
            self._send(self._gate.measure(time.monotonic_ns(), stamp, position, velocity))
            self.counters.measured.count += 1
        if self._decimator.passes(stamp or wall):
            self._publish_states(robot.pack(stamp or wall, values))

    def _on_command(self, data: bytes) -> None:
        try:
            stamp, (value,) = self._command_reader.read(data)
        except CdrError:
            self.counters.unreadable += 1
            return
        with self._lock:
            # Read under the lock, here and everywhere: for the gate, time does not run backwards between two threads.
            self._send(self._gate.command(time.monotonic_ns(), stamp, value))
            self.counters.commanded.count += 1

    def message(self, stamp: int, command: float) -> bytes | None:
        """Return a command as the robot's message; None where it cannot be told."""
        return self._robot.command(stamp, command)

    def applied(self, stamp: int, command: float) -> bytes:
        """Return a command as the message that is recorded."""
        return self._sent_writer.pack(stamp, (command,))

    def check_publishers(self) -> None:
        """Stop the motor while other nodes command the robot, or more than one node commands the bridge."""
        super().check_publishers()
        self._check_commanders()

    def _check_commanders(self) -> None:
        if self.parameters["allow_other_commanders"]:
            return
        text = several_commanders(self, self.subscriptions_by_topic["joint_command"].get_publisher_count())
        with self._lock:
            self._gate.forbid("commanders", text)

    def health(self) -> list[Status]:
        """Return the streams, and what the safety gate has done."""
        gate, robot = self._gate, self._robot
        streams = {
            "left_out": str(self._decimator.left_out),
            "clock_behind": f"{self._robot_clock.behind / 1e9:.6f}",
            "clock_jumps": str(gate.commands.jumps + gate.measurements.jumps),
            "stale": str(gate.commands.stale + gate.measurements.stale),
            "real_time_priority": str(self._urgent).lower(),
        }
        problem = ""
        if robot.seen and self.counters.measured.count == 0:
            topic = self.parameters["robot_states"]
            problem = f"no joint {robot.robot_names[0]} in {topic}: {', '.join(robot.seen)}"
        limits = {"limited": str(gate.limited), "rms": f"{gate.limiter.rms:.6g}", "work": f"{gate.limiter.work:.6g}"}
        return [self.counters.status(streams, self.count_publishers("joint_command"), problem), self.safety(limits)]


make = BridgeNode
