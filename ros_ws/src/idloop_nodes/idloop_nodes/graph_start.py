"""The start of a node in its graph: all streams connected, no second node of its name, all peers ready."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop_nodes import wiring
from idloop_nodes.duplicate_node_check import DISCOVERY_TIME, DuplicateNodeCheck
from idloop_nodes.progress import READY
from idloop_nodes.start_barrier import StartBarrier
from idloop_nodes.streams import stream_match

if TYPE_CHECKING:
    from idloop_nodes.base import StreamNode

CHECK_PERIOD = 0.5  # seconds between two checks for missing peers


class GraphStart:
    """Tells when a node may begin.

    Attributes: `ready`: whether this node has announced that its streams are connected.
    """

    def __init__(self, node: StreamNode) -> None:
        now = time.monotonic()
        self.ready = False
        self.duplicate = DuplicateNodeCheck(now, DISCOVERY_TIME if node.others else 0.0)
        self._node = node
        self._match = stream_match.StreamMatch()
        self._barrier = StartBarrier(node.others, node.parameters["start_timeout"], now)
        self._next_check = 0.0

    @property
    def waiting(self) -> bool:
        """Whether the node is not connected to its graph yet; a node without named peers belongs to any graph."""
        return not self.ready and bool(self._node.others)

    def partners(self) -> list[tuple[str, stream_match.Endpoints]]:
        """Return for every stream its topic, its connections, and how many of them the peers make expect."""
        node = self._node
        family = [*node.others, node.kind]
        publishers, subscriptions = node.publishers_by_topic, node.subscriptions_by_topic
        return [
            (topic, stream_match.subscribers(node, publisher, wiring.expected_subscribers(topic, family), family))
            for topic, publisher in publishers.items()
        ] + [
            (topic, stream_match.publishers(node, subscription, wiring.expected_publishers(topic, family), family))
            for topic, subscription in subscriptions.items()
        ]

    def unconnected(self) -> list[str]:
        """Return the topics of the streams that are not connected to all of their partners."""
        return [topic for topic, one in self.partners() if not one.complete]

    def connected(self) -> bool:
        """Whether every stream is connected to all partners that the peers make expect, other nodes aside."""
        return self._match.complete([one for _, one in self.partners()], time.monotonic())

    def announce(self) -> bool:
        """Tell the others once that this node is ready; return whether it is.

        Raises IdloopError: the peers do not appear in time.
        """
        if self.ready:
            return True
        if self.connected() and self._unique():
            self.ready = True
            self.duplicate.announced(time.monotonic())
            values = self._node.parameters.values
            about = [str(values[name]) for name in ("model", "mode") if values.get(name)]
            self._node.get_logger().info(f"ready: {', '.join(about)}" if about else "ready")
            self._node.tell_progress(0, READY)
        else:
            self._report_missing()
        return self.ready

    def peers_ready(self) -> bool:
        """Whether every other node of the graph has announced that it is ready as well."""
        if not self.announce():
            return False
        if len(self._node.progress.ready - {self._node.get_name()}) >= len(self._node.others):
            return True
        self._report_missing()
        return False

    def refuse_duplicate(self) -> InputError | None:
        """Take in that a node of this name is ready; return the error of this node when it is the second one."""
        if not self.duplicate.is_second(time.monotonic()):
            return None
        node = self._node
        return InputError(
            f"another node {node.get_fully_qualified_name()} runs in ROS domain {node.context.get_domain_id()}: two "
            "graphs in one domain and namespace mix up; give this one a domain of its own (ROS_DOMAIN_ID, "
            "idloop launch --domain N) or a namespace, or end the other"
        )

    def _unique(self) -> bool:
        """Whether no other node of this name is known."""
        names = self._node.get_node_names_and_namespaces()
        count = names.count((self._node.get_name(), self._node.get_namespace()))
        return self.duplicate.is_unique(count, time.monotonic())

    def _report_missing(self) -> None:
        """Log what this node waits for; raise IdloopError after the time limit of the peers."""
        now = time.monotonic()
        if not self._node.others or now < self._next_check:
            return
        self._next_check = now + CHECK_PERIOD
        namespace = self._node.get_namespace()
        running = {name for name, where in self._node.get_node_names_and_namespaces() if where == namespace}
        notice = self._barrier.notice(self._node.progress.ready, running, self.unconnected(), now)
        if notice:
            self._node.get_logger().warning(notice)
