"""What every bridge does beside its own streams: watchdog, guardian, emergency stop, competing publishers, end."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any, Generic

from rclpy.duration import Duration

from idloop_nodes import qos
from idloop_nodes.codec import Level, Status
from idloop_nodes.managed_node import EmergencyStop, ManagedNode
from idloop_nodes.safety.guardian_link import BridgeEnd, Hello, address
from idloop_nodes.safety.interlock import Command, Interlock
from idloop_nodes.safety.last_node import MESSAGES, PRIORITY, TICK, competing_publishers
from idloop_nodes.safety.robot_joints import RobotClock
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.timing import become_urgent

CHECK_PERIOD = 0.05  # seconds between checks for other nodes that command the robot
ACKNOWLEDGE = Duration(nanoseconds=200_000_000)  # longest wait for the robot to acknowledge the last command
GUARDIAN_TIMEOUT_NS = 40_000_000  # silence after which the guardian counts as hung; it beats every 5 ms
LOCK_TIMEOUT = 0.02  # seconds for which the last command waits for a thread that may hang

FULL_LOAD = 0.9  # share of a processor core beyond which messages begin to wait


class BridgeCounters:
    """What a bridge counts; `load`: processor time of the thread that forwards messages [s]."""

    def __init__(self) -> None:
        self.measured, self.commanded, self.sent, self.load = (RateCounter() for _ in range(4))
        self.unreadable = 0

    def status(self, values: dict[str, str], commanders: int, problem: str) -> Status:
        """Return the check of the streams; a `problem` goes before all others."""
        rate, load = self.measured.rate(), self.load.rate()
        counts = {
            "measurements": str(self.measured.count),
            "measurement_rate": f"{rate:.1f}",
            "load": f"{load:.2f}",
            "commands": str(self.commanded.count),
            "command_rate": f"{self.commanded.rate():.1f}",
            "sent": str(self.sent.count),
            "sent_rate": f"{self.sent.rate():.1f}",
            "unreadable": str(self.unreadable),
            "commanders": str(commanders),
        }
        text, level = "ok", Level.OK
        if commanders > 1:
            text, level = f"{commanders} nodes publish joint_command", Level.WARN
        if load > FULL_LOAD:
            text, level = f"overloaded: this processor serves about {rate / load:.0f} measurements/s", Level.WARN
        if problem:
            text, level = problem, Level.ERROR
        return Status("streams", text, level, counts | values)


class GuardedNode(ManagedNode, Generic[Command]):
    """The last node before a motor: sends what a gate lets pass.

    A thread checks the watchdog whatever the executor does, and sends the guardian a beat after each check. A subclass
    takes in the streams, and turns commands into messages.
    """

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.counters = BridgeCounters()
        self._lock = threading.Lock()
        self._robot_clock = RobotClock()
        self._publish_sent = self.publisher("bridge/command")
        self._stop = threading.Event()
        self._reported = ""
        self._next_check = 0.0
        self._urgent = False

    def guard(self, gate: Interlock[Command], command_type: str) -> None:
        """Begin to drive the motor through a gate; the last call of a subclass's constructor."""
        values = self.parameters
        self._gate = gate
        self._to_robot: Any = self.create_publisher(MESSAGES[command_type], values["robot_commands"], qos.stream(1))
        self._emergency = EmergencyStop(self, self._lock, self._stop_motor, gate.reset, "soft start")
        self._guardian = self._guardian_link(command_type) if values["require_guardian"] else None
        self._thread = self.thread(self._watch, "watchdog")
        self._thread.start()
        self.start_by_itself()

    def _guardian_link(self, command_type: str) -> BridgeEnd:
        topic = self.resolve_topic_name(self.parameters["robot_commands"])
        where = address(self.context.get_domain_id(), self.get_fully_qualified_name())
        return BridgeEnd(where, Hello(topic, command_type), GUARDIAN_TIMEOUT_NS)

    # what a subclass fills in

    def message(self, stamp: int, command: Command) -> bytes | None:
        """Return a command as the robot's message; None where it cannot be told."""
        raise NotImplementedError

    def applied(self, stamp: int, command: Command) -> bytes:
        """Return a command as the message that is recorded; `stamp`: in the robot's clock."""
        raise NotImplementedError

    # what is sent

    def _watch(self) -> None:
        self._urgent = become_urgent(PRIORITY)
        guardian = self._guardian
        while not self._stop.wait(TICK):
            unguarded = "" if guardian is None else guardian.listen(time.monotonic_ns())
            with self._lock:
                now = time.monotonic_ns()
                if guardian is not None and guardian.intervened:
                    self._gate.handed_over()
                self._gate.forbid("guardian", unguarded)
                self._send(self._gate.tick(now))
                neutral_afterwards = self._gate.neutral_command(now)
            # Only now: a beat confirms that this thread, the lock and the middleware all work.
            if guardian is not None:
                guardian.beat(self._message(time.time_ns(), neutral_afterwards) or b"")

    def _send(self, command: Command | None) -> None:
        """Publish to the robot, then to the recorder; the caller holds the lock."""
        stamp = time.time_ns()
        message = self._message(stamp, command)
        if message is not None and command is not None:
            self._to_robot.publish(message)
            self._publish_sent(self.applied(self._robot_clock.stamp(stamp), command))
            self.counters.sent.count += 1

    def _message(self, stamp: int, command: Command | None) -> bytes | None:
        return None if command is None else self.message(stamp, command)

    def poll(self) -> None:
        """Check for other nodes that command the robot, and report once why the motor is stopped."""
        super().poll()
        self.counters.load.count = time.thread_time()
        now = time.monotonic()
        if now >= self._next_check:
            self._next_check = now + CHECK_PERIOD
            self.check_publishers()
        reason = self._gate.reason
        if reason != self._reported:
            self._reported = reason
            if reason:
                self.get_logger().warning(f"the motor is stopped: {reason}")
            else:
                self.get_logger().info("commands pass, with a soft start")

    def check_publishers(self) -> None:
        """Stop the motor while other nodes command the robot."""
        known = [self.get_fully_qualified_name(), "" if self._guardian is None else self._guardian.guardian]
        text = competing_publishers(self, self.parameters["robot_commands"], known)
        with self._lock:
            self._gate.forbid("rivals", text)

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

    def safety(self, more: dict[str, str]) -> Status:
        """Return what the gate has done as a health check; `more`: further key values."""
        gate = self._gate
        values = {"active": str(self.active).lower(), "latched": gate.latched, "faults": str(gate.faults)}
        level = Level.ERROR if gate.latched else Level.WARN if gate.reason and self.active else Level.OK
        return Status("safety", gate.reason or "commands pass", level, values | more)
