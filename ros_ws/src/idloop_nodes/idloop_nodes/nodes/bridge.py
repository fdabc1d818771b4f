"""The bridge: between our topics and a robot's, the last node before its motor."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

from rclpy.duration import Duration
from sensor_msgs.msg import JointState

from idloop_nodes import qos
from idloop_nodes.codec import CdrError, JointReader, JointWriter, Level, Status
from idloop_nodes.deadlines import become_urgent
from idloop_nodes.managed_node import ManagedNode
from idloop_nodes.safety.bridge_counters import BridgeCounters
from idloop_nodes.safety.competing_publishers import competing_publishers, refuse_loops, several_commanders
from idloop_nodes.safety.emergency_stop import EmergencyStop
from idloop_nodes.safety.gate_settings import gate_settings
from idloop_nodes.safety.guardian_link import BridgeEnd, Hello, address
from idloop_nodes.safety.last_node import MESSAGES, PRIORITY, TICK, prepare
from idloop_nodes.safety.robot_clock import RobotClock
from idloop_nodes.safety.robot_joints import RobotJoints
from idloop_nodes.safety.safety_gate import SafetyGate
from idloop_nodes.streams.decimator import Decimator

__all__ = ["BridgeNode", "make", "prepare"]

CHECK_PERIOD = 0.05  # seconds between checks for other nodes that command the robot
ACKNOWLEDGE = Duration(nanoseconds=200_000_000)  # longest wait for the robot to acknowledge the last command
GUARDIAN_TIMEOUT_NS = 40_000_000  # silence after which the guardian counts as hung; it beats every 5 ms
LOCK_TIMEOUT = 0.02  # seconds for which the last command waits for a thread that may hang


class BridgeNode(ManagedNode):
    """Turns a robot's messages into ours and ours into the robot's, through a `SafetyGate`.

    Every message is forwarded on arrival; a thread checks the watchdog whatever the executor does, and sends the
    guardian a beat after each check.
    """

    def __init__(self) -> None:
        super().__init__("bridge")
        values = self.parameters
        self._robot = RobotJoints(values.values)
        self._gate = SafetyGate(gate_settings(values.values))
        refuse_loops(self)
        self._lock = threading.Lock()
        self._command_reader = JointReader([(self._robot.names[0], "effort")])
        self._sent_writer = JointWriter(self._robot.names[:1], ["effort"])
        self._robot_clock = RobotClock()
        self._decimator = Decimator(values["measurement_rate"])
        self.counters = BridgeCounters()
        self._reported = ""
        self._next_check = 0.0
        self._urgent = False
        self._publish_states = self.publisher("joint_states")
        self._publish_sent = self.publisher("bridge/command")
        self._to_robot: Any = self.create_publisher(
            MESSAGES[values["command_type"]], values["robot_commands"], qos.newest()
        )
        profile = qos.robot(reliable=values["reliable"])
        self.subscribe(JointState, values["robot_states"], self._on_measurement, profile)
        # Only the newest command counts: a bridge that was held up must not play back what has passed.
        self.subscriptions_by_topic["joint_command"] = self.subscribe(
            JointState,
            "joint_command",
            self._on_command,
            qos.newest(),
            # Known before the first command of the newcomer.
            matched=lambda info: self._check_commanders(),
        )
        self._emergency = EmergencyStop(self, self._lock, self._stop_motor, self._gate.reset, "soft start")
        self._guardian = self._guardian_link() if values["require_guardian"] else None
        self._stop = threading.Event()
        self._thread = self.thread(self._watch, "watchdog")
        self._thread.start()
        self.start_by_itself()

    def _guardian_link(self) -> BridgeEnd:
        topic = self.resolve_topic_name(self.parameters["robot_commands"])
        where = address(self.context.get_domain_id(), self.get_fully_qualified_name())
        return BridgeEnd(where, Hello(topic, self.parameters["command_type"]), GUARDIAN_TIMEOUT_NS)

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

    def _watch(self) -> None:
        self._urgent = become_urgent(PRIORITY)
        guardian = self._guardian
        while not self._stop.wait(TICK):
            unguarded = "" if guardian is None else guardian.listen(time.monotonic_ns())
            with self._lock:
                now = time.monotonic_ns()
                self._gate.forbid("guardian", unguarded)
                self._send(self._gate.tick(now))
                neutral_afterwards = self._gate.neutral_command(now)
            # Only now: a beat confirms that this thread, the lock and the middleware all work.
            if guardian is not None:
                guardian.beat(self._message(time.time_ns(), neutral_afterwards) or b"")

    def _send(self, command: float | None) -> None:
        """Publish to the robot, then to the recorder; the caller holds the lock."""
        stamp = time.time_ns()
        message = self._message(stamp, command)
        if message is not None and command is not None:
            self._to_robot.publish(message)
            self._publish_sent(self._sent_writer.pack(self._robot_clock.stamp(stamp), (command,)))
            self.counters.sent.count += 1

    def _message(self, stamp: int, command: float | None) -> bytes | None:
        return None if command is None else self._robot.command(stamp, command)

    def poll(self) -> None:
        """Check for other nodes that command the robot, and report once why the motor is stopped."""
        super().poll()
        self.counters.load.count = time.thread_time()
        now = time.monotonic()
        if now >= self._next_check:
            self._next_check = now + CHECK_PERIOD
            self._check_publishers()
        reason = self._gate.reason
        if reason != self._reported:
            self._reported = reason
            if reason:
                self.get_logger().warning(f"the motor is stopped: {reason}")
            else:
                self.get_logger().info("commands pass, with a soft start")

    def _check_publishers(self) -> None:
        """Stop the motor while other nodes command the robot, or more than one node commands the bridge."""
        known = [self.get_fully_qualified_name(), "" if self._guardian is None else self._guardian.guardian]
        text = competing_publishers(self, self.parameters["robot_commands"], known)
        with self._lock:
            self._gate.forbid("rivals", text)
        self._check_commanders()

    def _check_commanders(self) -> None:
        if self.parameters["allow_other_commanders"]:
            return
        text = several_commanders(self, self.subscriptions_by_topic["joint_command"].get_publisher_count())
        with self._lock:
            self._gate.forbid("commanders", text)

    # lifecycle, services, health

    def activated(self) -> None:
        """Let commands pass."""
        with self._lock:
            self._gate.activate()

    def deactivated(self) -> None:
        """Stop the motor at once."""
        with self._lock:
            self._send(self._gate.deactivate(time.monotonic_ns()))

    def _stop_motor(self) -> None:
        self._send(self._gate.stop(time.monotonic_ns()))

    def thread_failed(self) -> None:
        """Stop the motor at once when a thread of this node has ended with an error."""
        self._send_neutral()

    def _send_neutral(self) -> None:
        """Send the neutral command, whatever else hangs."""
        locked = self._lock.acquire(timeout=LOCK_TIMEOUT)
        try:
            self._send(self._gate.deactivate(time.monotonic_ns()))
        finally:
            if locked:
                self._lock.release()

    def close(self) -> None:
        """Leave a motor behind that stands still."""
        self._send_neutral()
        self._stop.set()
        self._thread.join(timeout=1.0)
        self._send_neutral()
        with contextlib.suppress(Exception):  # without a robot nothing is acknowledged
            self._to_robot.wait_for_all_acked(ACKNOWLEDGE)
        if self._guardian is not None:
            self._guardian.close()

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
        safety = {
            "active": str(self.active).lower(),
            "latched": gate.latched,
            "faults": str(gate.faults),
            "limited": str(gate.limited),
            "rms": f"{gate.limiter.rms:.6g}",
            "work": f"{gate.limiter.work:.6g}",
        }
        state = Level.ERROR if gate.latched else Level.WARN if gate.reason and self.active else Level.OK
        return [
            self.counters.status(streams, self.count_publishers("joint_command"), problem),
            Status("safety", gate.reason or "commands pass", state, safety),
        ]


make = BridgeNode
