"""The guardian: stops the motor when the bridge, the last node before it, dies or hangs."""

from __future__ import annotations

import select
import threading
import time
from typing import Any

from idloop.records.bags.cdr import SECOND
from idloop_nodes import qos
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import Level, Status
from idloop_nodes.codec.diagnostics import absolute_name
from idloop_nodes.safety.guardian_link import STOPPED, WAITS, WATCHES, GuardianEnd, Hello, SilenceWatch, address
from idloop_nodes.safety.last_node import MESSAGES, PRIORITY, TICK, prepare
from idloop_nodes.timing import become_urgent

__all__ = ["GuardianNode", "make", "prepare"]


class GuardianNode(StreamNode):
    """Watches the bridge's beats in a thread that neither the executor nor the middleware can hold up."""

    poll_period = 0.02

    def __init__(self) -> None:
        super().__init__("guardian")
        values = self.parameters
        self._bridge = absolute_name(self.get_namespace(), values["bridge"])
        self._watch = SilenceWatch(round(values["silence"] * SECOND))
        self._link = GuardianEnd(address(self.context.get_domain_id(), self._bridge))
        self._hello: Hello | None = None
        self._to_robot: Any = None
        self._robot_connected = False
        self._reported = False
        self._stop = threading.Event()
        self._thread = self.thread(self._run, "guardian")
        self._thread.start()

    def _run(self) -> None:
        become_urgent(PRIORITY)
        name = self.get_fully_qualified_name()
        link, watch = self._link, self._watch
        while not self._stop.is_set():
            select.select(link.sockets, [], [], TICK)
            now = time.monotonic_ns()
            neutral, gone = link.receive()
            before = watch.intervening
            if neutral is not None:
                watch.beat(now, neutral)
            if gone:
                watch.gone(now)
            message = watch.tick(now)
            if message and self._to_robot is not None:
                self._to_robot.handle.publish_raw(message)
            # The first beat after a silence is answered with it, too: the bridge has to start softly again.
            link.send(STOPPED if before or watch.intervening else WATCHES if self._robot_connected else WAITS, name)

    def poll(self) -> None:
        """Make the publisher that the bridge asks for, check that the robot subscribes, and report interventions."""
        super().poll()
        hello = self._link.hello
        if hello is not None and hello != self._hello:
            self._robot_connected = False
            if self._to_robot is not None:
                self.destroy_publisher(self._to_robot)
            self._to_robot = self.create_publisher(MESSAGES[hello.message], hello.topic, qos.stream(1))
            self._hello = hello
            self.get_logger().info(f"watches {self._bridge}, which commands the robot on {hello.topic}")
        self._robot_connected = self._to_robot is not None and self._to_robot.get_subscription_count() > 0
        intervening = self._watch.intervening
        if intervening != self._reported:
            self._reported = intervening
            if intervening:
                self.get_logger().error(f"{self._bridge} is silent or gone: the guardian stops the motor")
            else:
                self.get_logger().info(f"{self._bridge} is back: no longer sends in its place")

    def close(self) -> None:
        """End the link: the bridge then stops the motor."""
        self._stop.set()
        self._thread.join(timeout=1.0)
        self._link.close()

    def health(self) -> list[Status]:
        """Return whether it watches, and what it has done."""
        watch = self._watch
        if watch.intervening:
            text, level = f"{self._bridge} is silent or gone: the guardian stops the motor", Level.ERROR
        elif not self._link.connected:
            text, level = f"no bridge {self._bridge}", Level.WARN
        else:
            text, level = (
                ("watches", Level.OK) if self._robot_connected else ("the robot does not subscribe yet", Level.WARN)
            )
        values = {
            "bridge": self._bridge,
            "interventions": str(watch.interventions),
            "longest_silence": f"{watch.longest_ns / SECOND:.4f}",
        }
        return [Status("watch", text, level, values)]


make = GuardianNode
