"""The guardian: stops the motor when the bridge, the last node before it, dies or hangs."""

from __future__ import annotations

import select
import threading
import time
from typing import Any

from idloop_nodes import qos
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import Level, Status
from idloop_nodes.deadlines import become_urgent
from idloop_nodes.safety.command_limiter import SECOND
from idloop_nodes.safety.guardian_link import STOPPED, WAITS, WATCHES, GuardianEnd, Hello, address
from idloop_nodes.safety.last_node import MESSAGES, PRIORITY, TICK, prepare
from idloop_nodes.safety.silence_watch import SilenceWatch
from idloop_nodes.tables import GUARDIAN

__all__ = ["GuardianNode", "make", "prepare"]


class GuardianNode(StreamNode):
    """Hears from the bridge, over a Unix socket, that it is alive and which message stops the motor.

    A thread that neither the executor nor the middleware can hold up watches the socket.
    """

    poll_period = 0.02

    def __init__(self) -> None:
        super().__init__("guardian", GUARDIAN)
        values = self.parameters
        self._bridge = self.resolve_node_name(values["bridge"])
        self._watch = SilenceWatch(round(values["silence"] * SECOND))
        self._link = GuardianEnd(address(self.context.get_domain_id(), self._bridge))
        self._hello: Hello | None = None
        self._to_robot: Any = None
        self._met = False
        self._said = False
        self._stop = threading.Event()
        self._thread = self.thread(self._run, "guardian")
        self._thread.start()

    def resolve_node_name(self, name: str) -> str:
        """Return the fully qualified name of a node of this namespace."""
        return name if name.startswith("/") else f"{self.get_namespace().rstrip('/')}/{name}"

    def _run(self) -> None:
        become_urgent(PRIORITY)
        name = self.get_fully_qualified_name()
        link, watch = self._link, self._watch
        while not self._stop.is_set():
            select.select(link.sockets, [], [], TICK)
            now = time.monotonic_ns()
            neutral, gone = link.receive()
            spoke = watch.speaks
            if neutral is not None:
                watch.beat(now, neutral)
            if gone:
                watch.gone(now)
            message = watch.tick(now)
            if message and self._to_robot is not None:
                self._to_robot.handle.publish_raw(message)
            # The first beat after a silence is answered with it, too: the bridge has to start softly again.
            link.send(STOPPED if spoke or watch.speaks else WATCHES if self._met else WAITS, name)

    def poll(self) -> None:
        """Make the publisher that the bridge asks for, look whether the robot listens, and say what was done."""
        super().poll()
        hello = self._link.hello
        if hello is not None and hello != self._hello:
            self._met = False
            if self._to_robot is not None:
                self.destroy_publisher(self._to_robot)
            self._to_robot = self.create_publisher(MESSAGES[hello.message], hello.topic, qos.newest())
            self._hello = hello
            self.get_logger().info(f"watches {self._bridge}, which commands the robot on {hello.topic}")
        self._met = self._to_robot is not None and self._to_robot.get_subscription_count() > 0
        speaks = self._watch.speaks
        if speaks != self._said:
            self._said = speaks
            if speaks:
                self.get_logger().error(f"{self._bridge} is silent or gone: the motor is told to stop")
            else:
                self.get_logger().info(f"no longer speaks for {self._bridge}")

    def close(self) -> None:
        """End the link: the bridge then stops the motor."""
        self._stop.set()
        self._thread.join(timeout=1.0)
        self._link.close()

    def health(self) -> list[Status]:
        """Return whether it watches, and what it has done."""
        watch = self._watch
        if watch.speaks:
            text, level = f"{self._bridge} is silent or gone: the motor is told to stop", Level.ERROR
        elif not self._link.connected:
            text, level = f"no bridge {self._bridge}", Level.WARN
        else:
            text, level = ("watches", Level.OK) if self._met else ("the robot does not listen yet", Level.WARN)
        values = {
            "bridge": self._bridge,
            "interventions": str(watch.interventions),
            "longest_silence": f"{watch.longest_ns / SECOND:.4f}",
        }
        return [Status("watch", text, level, values)]


def make() -> GuardianNode:
    """Build the node."""
    return GuardianNode()
