"""The bridge: between our topics and a robot's, and the last node before its motor."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from sensor_msgs.msg import JointState

from idloop.errors import InputError
from idloop_nodes import qos
from idloop_nodes.base import ManagedNode
from idloop_nodes.codec import CdrError, JointReader, JointWriter, Level, Status
from idloop_nodes.deadlines import become_urgent
from idloop_nodes.safety.emergency_stop import EmergencyStop
from idloop_nodes.safety.gate_settings import gate_settings
from idloop_nodes.safety.guardian_link import BridgeEnd, Hello, address
from idloop_nodes.safety.last_node import MESSAGES, PRIORITY, TICK, prepare
from idloop_nodes.safety.robot_clock import RobotClock
from idloop_nodes.safety.robot_joints import RobotJoints
from idloop_nodes.safety.safety_gate import SafetyGate
from idloop_nodes.streams.decimator import Decimator
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.tables import BRIDGE

__all__ = ["BridgeNode", "make", "prepare"]

LOOK_PERIOD = 0.05  # seconds between looks at who else commands the robot
FAREWELL = Duration(nanoseconds=200_000_000)  # longest wait for the robot to acknowledge the last command
GUARDIAN_PATIENCE_NS = 40_000_000  # silence after which the guardian counts as hung; it beats every 5 ms
FULL = 0.9  # share of a processor core beyond which messages begin to wait
LOCK_PATIENCE = 0.02  # seconds for which the last command waits for a thread that may hang


class BridgeNode(ManagedNode):
    """Turns a robot's messages into ours and ours into the robot's, through a `SafetyGate`.

    Every message is passed on when it comes; a thread looks at the watchdog whatever the executor does, and shows the
    guardian after each look that it has.
    """

    def __init__(self) -> None:
        super().__init__("bridge", BRIDGE)
        values = self.parameters
        self._robot = RobotJoints(values.values)
        self._gate = SafetyGate(gate_settings(values.values))
        self._refuse_loops()
        self._lock = threading.Lock()
        self._command_reader = JointReader([(self._robot.names[0], "effort")])
        self._sent_writer = JointWriter(self._robot.names[:1], ["effort"])
        self._robot_clock = RobotClock()
        self._decimator = Decimator(values["measurement_rate"])
        self._measured = RateCounter()
        self._commanded = RateCounter()
        self._sent = RateCounter()
        self._load = RateCounter()  # processor time of the thread that passes messages on, per second
        self._unreadable = 0
        self._said = ""
        self._look_again = 0.0
        self._urgent = False
        self._publish_states = self.publisher("joint_states")
        self._publish_sent = self.publisher("bridge/command")
        self._to_robot: Any = self.create_publisher(
            MESSAGES[values["command_type"]], values["robot_commands"], qos.newest()
        )
        self.create_subscription(
            JointState, values["robot_states"], self._on_measurement, qos.robot(reliable=values["reliable"]), raw=True
        )
        # Only the newest command counts: a bridge that was held up must not play back what has passed.
        self._subscriptions_by_topic["joint_command"] = self.create_subscription(
            JointState,
            "joint_command",
            self._on_command,
            qos.newest(),
            raw=True,
            # Known before the first command of the newcomer.
            event_callbacks=SubscriptionEventCallbacks(matched=lambda info: self._look_for_commanders()),
        )
        self._emergency = EmergencyStop(self, self._lock, self._stop_motor, self._gate.reset, "soft start")
        self._guardian = self._guardian_link() if values["require_guardian"] else None
        self._stop = threading.Event()
        self._thread = self.thread(self._watch, "watchdog")
        self._thread.start()
        self.start_by_itself()

    def _refuse_loops(self) -> None:
        for parameter, ours in (("robot_states", "joint_states"), ("robot_commands", "joint_command")):
            topic = self.resolve_topic_name(self.parameters[parameter])
            if topic == self.resolve_topic_name(ours):
                raise InputError(
                    f"bridge: {parameter} is {topic}, which is our own {ours}; start the graph in a namespace "
                    "(-r __ns:=/axis) or give the robot's topic another name"
                )

    def _guardian_link(self) -> BridgeEnd:
        topic = self.resolve_topic_name(self.parameters["robot_commands"])
        where = address(self.context.get_domain_id(), self.get_fully_qualified_name())
        return BridgeEnd(where, Hello(topic, self.parameters["command_type"]), GUARDIAN_PATIENCE_NS)

    # streams

    def _on_measurement(self, data: bytes) -> None:
        wall = time.time_ns()
        try:
            read = self._robot.read(data)
        except CdrError:
            self._unreadable += 1
            return
        if read is None:
            return
        stamp, values = read
        robot = self._robot
        position, velocity = robot.measured(values, "position"), robot.measured(values, "velocity")
        with self._lock:
            self._robot_clock.hear(stamp, wall)
            self._send(self._gate.measure(time.monotonic_ns(), stamp, position, velocity))
            self._measured.count += 1
        if self._decimator.passes(stamp or wall):
            self._publish_states(robot.pack(stamp or wall, values))

    def _on_command(self, data: bytes) -> None:
        try:
            stamp, (value,) = self._command_reader.read(data)
        except CdrError:
            self._unreadable += 1
            return
        with self._lock:
            # Read under the lock, here and everywhere: for the gate, time does not run backwards between two threads.
            self._send(self._gate.command(time.monotonic_ns(), stamp, value))
            self._commanded.count += 1

    def _watch(self) -> None:
        self._urgent = become_urgent(PRIORITY)
        guardian = self._guardian
        while not self._stop.wait(TICK):
            unguarded = "" if guardian is None else guardian.listen(time.monotonic_ns())
            with self._lock:
                now = time.monotonic_ns()
                self._gate.forbid("guardian", unguarded)
                self._send(self._gate.tick(now))
                farewell = self._gate.farewell(now)
            # Only now: a beat says that this thread, the lock and the middleware all work.
            if guardian is not None:
                guardian.beat(self._message(time.time_ns(), farewell) or b"")

    def _send(self, command: float | None) -> None:
        """Tell the robot, then the recorder; the caller holds the lock."""
        stamp = time.time_ns()
        message = self._message(stamp, command)
        if message is not None and command is not None:
            self._to_robot.publish(message)
            self._publish_sent(self._sent_writer.pack(self._robot_clock.stamp(stamp), (command,)))
            self._sent.count += 1

    def _message(self, stamp: int, command: float | None) -> bytes | None:
        return None if command is None else self._robot.command(stamp, command)

    def poll(self) -> None:
        """Look for others who command the robot, and say once why the motor stands still."""
        super().poll()
        self._load.count = time.thread_time()
        now = time.monotonic()
        if now >= self._look_again:
            self._look_again = now + LOOK_PERIOD
            self._look_for_rivals()
        reason = self._gate.reason
        if reason != self._said:
            self._said = reason
            if reason:
                self.get_logger().warning(f"the motor is stopped: {reason}")
            else:
                self.get_logger().info("commands pass, with a soft start")

    def _look_for_rivals(self) -> None:
        """What others publish to the robot goes past every limit: then at least nothing comes from here."""
        topic = self.parameters["robot_commands"]
        known = [self.get_fully_qualified_name(), "" if self._guardian is None else self._guardian.guardian]
        publishers = [_name(one) for one in self.get_publishers_info_by_topic(topic)]
        rivals = [one for one in publishers if one not in known]
        # A second process under a name that is known is a rival as well.
        rivals += [name for name in known if publishers.count(name) > 1]
        text = f"others publish on {topic}, past all limits: {', '.join(sorted(set(rivals)))}" if rivals else ""
        with self._lock:
            self._gate.forbid("rivals", text)
        self._look_for_commanders()

    def _look_for_commanders(self) -> None:
        """Nobody knows which of two commands is meant: then neither passes."""
        if self.parameters["allow_other_commanders"]:
            return
        count = self._subscriptions_by_topic["joint_command"].get_publisher_count()
        text = ""
        if count > 1:
            names = ", ".join(sorted(_name(one) for one in self.get_publishers_info_by_topic("joint_command")))
            text = f"{count} nodes publish joint_command ({names}): end all but one, or set allow_other_commanders"
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
        self._last_word()

    def _last_word(self) -> None:
        """Send the neutral command, whatever else hangs."""
        locked = self._lock.acquire(timeout=LOCK_PATIENCE)
        try:
            self._send(self._gate.deactivate(time.monotonic_ns()))
        finally:
            if locked:
                self._lock.release()

    def close(self) -> None:
        """Leave a motor behind that stands still."""
        self._last_word()
        self._stop.set()
        self._thread.join(timeout=1.0)
        self._last_word()
        with contextlib.suppress(Exception):  # without a robot there is nobody to acknowledge
            self._to_robot.wait_for_all_acked(FAREWELL)
        if self._guardian is not None:
            self._guardian.close()

    def health(self) -> list[Status]:
        """Return the streams, and what the safety gate has done."""
        gate, robot = self._gate, self._robot
        commanders = self.count_publishers("joint_command")
        driven = robot.robot_names[0]
        strangers = robot.seen if self._measured.count == 0 else ()
        rate, load = self._measured.rate(), self._load.rate()
        streams = {
            "measurements": str(self._measured.count),
            "measurement_rate": f"{rate:.1f}",
            "left_out": str(self._decimator.left_out),
            "load": f"{load:.2f}",
            "commands": str(self._commanded.count),
            "command_rate": f"{self._commanded.rate():.1f}",
            "sent": str(self._sent.count),
            "sent_rate": f"{self._sent.rate():.1f}",
            "clock_behind": f"{self._robot_clock.behind / 1e9:.6f}",
            "clock_jumps": str(gate.commands.jumps + gate.measurements.jumps),
            "stale": str(gate.commands.stale + gate.measurements.stale),
            "unreadable": str(self._unreadable),
            "commanders": str(commanders),
            "real_time_priority": str(self._urgent).lower(),
        }
        text, level = "ok", Level.OK
        if commanders > 1:
            text, level = f"{commanders} nodes publish joint_command", Level.WARN
        if load > FULL:
            text, level = f"overloaded: this processor serves about {rate / load:.0f} measurements/s", Level.WARN
        if strangers:
            text, level = f"no joint {driven} in {self.parameters['robot_states']}: {', '.join(strangers)}", Level.ERROR
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
            Status("streams", text, level, streams),
            Status("safety", gate.reason or "commands pass", state, safety),
        ]


def _name(endpoint: Any) -> str:
    """Fully qualified name of the node that an endpoint belongs to."""
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def make() -> BridgeNode:
    """Build the node."""
    return BridgeNode()
