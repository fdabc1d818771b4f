"""The start of a node in its graph: all streams connected, no second node of its name, all peers ready."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.errors import IdloopError, InputError
from idloop.records.bags.topics import APPLIED_COMMAND, REQUESTED_COMMAND
from idloop_nodes.descriptions import KINDS, describe
from idloop_nodes.progress import READY
from idloop_nodes.streams.stream_match import Endpoints, StreamMatch, partners

if TYPE_CHECKING:
    from idloop_nodes.base import StreamNode

# A running peer may need minutes before it is ready: on the first start it compiles.
RUNNING_PEER_FACTOR = 20.0
NOTICE = 10.0  # seconds after which a node reports for whom it waits; then whenever that has changed
NEW = 1.0  # seconds after its announcement in which a node that meets another of its name counts as the second
DISCOVERY_TIME = 1.0  # seconds after its start in which a node discovers the others: two of their announcements
CHECK_PERIOD = 0.5  # seconds between two checks for missing peers


def command_topic(topic: str, family: Iterable[str]) -> str:
    """Return the topic of the commands that a machine received: behind a bridge the applied command."""
    return APPLIED_COMMAND if topic == REQUESTED_COMMAND and "bridge" in family else topic


def subscriptions(kind: str, family: Iterable[str]) -> tuple[str, ...]:
    """Return the topics that a kind of node subscribes to in a graph of these kinds."""
    if kind not in KINDS:
        return ()
    node = describe(kind)
    if not node.uses_applied_command:
        return node.subscribes
    return tuple(command_topic(topic, family) for topic in node.subscribes)


def expected_subscribers(topic: str, peers: Collection[str]) -> int:
    """Return how many of `peers` subscribe `topic`."""
    return sum(topic in subscriptions(peer, peers) for peer in peers)


def expected_publishers(topic: str, peers: Iterable[str]) -> int:
    """Return how many of `peers` publish `topic`."""
    return sum(topic in describe(peer).publishes for peer in peers if peer in KINDS)


@dataclass
class StartBarrier:
    """Watches the time that the other nodes of a graph take to get ready."""

    peers: Sequence[str]  # their names
    limit: float  # longest wait for one that does not appear [s]; a running one has RUNNING_PEER_FACTOR times as long
    born: float  # beginning of the wait, of a clock that never jumps [s]
    reported: str = ""  # for whom the node waited at the last notice

    def notice(self, ready: Collection[str], running: Collection[str], unconnected: Sequence[str], now: float) -> str:
        """Return for whom the node waits when that has changed, else nothing; IdloopError: the time limit is over."""
        late = [name for name in self.peers if name not in ready]
        absent = [name for name in late if name not in running]
        compiling = [name for name in late if name in running]
        waited = now - self.born
        if absent and waited > self.limit:
            raise IdloopError(
                f"{', '.join(absent)} did not appear within {self.limit:g} s (parameter start_timeout); check the "
                "parameter peers, the names of the nodes, and that all of them run in one ROS domain and namespace"
            )
        what = "; ".join(
            f"{', '.join(names)} {state}"
            for names, state in (
                (absent, "not there yet"),
                (compiling, "there, not ready (a first start compiles)"),
                ([] if late else unconnected, "not connected with all who are there"),
            )
            if names
        )
        longest = RUNNING_PEER_FACTOR * self.limit
        if waited > longest:
            raise IdloopError(f"gave up after {longest:g} s (20 times start_timeout): {what or 'nobody is ready'}")
        if waited < NOTICE or what in ("", self.reported):
            return ""
        self.reported = what
        return f"waits: {what}"


@dataclass
class DuplicateNodeCheck:
    """What a node knows of others of its name; times are of a clock that never jumps [s]."""

    discovered_at: float  # time from which all others are known
    announcement: float | None = None  # time at which this node has announced itself
    announcements: int = 0  # of nodes of this name
    known: float | None = None  # time since which another one is known

    def is_unique(self, count: int, now: float) -> bool:
        """Whether no other of `count` nodes of this name will announce itself: a dead one stays known for a while."""
        if now < self.discovered_at:
            return False
        if count < 2:
            return True
        self.known = now if self.known is None else self.known
        return now - self.known >= NEW

    def announced(self, now: float) -> None:
        """Remember that this node announces itself now."""
        self.announcement = now

    def is_second(self, now: float) -> bool:
        """Take in an announcement of a node of this name; return whether this node is the second and must end."""
        self.announcements += 1
        if self.announcement is None:
            return True
        return self.announcements > 1 and now - self.announcement < NEW


class GraphStart:
    """Tells when a node may begin; `ready` once it has announced that its streams are connected."""

    def __init__(self, node: StreamNode) -> None:
        now = time.monotonic()
        self.ready = False
        self.duplicate = DuplicateNodeCheck(now + (DISCOVERY_TIME if node.others else 0.0))
        self._node = node
        self._match = StreamMatch()
        self._barrier = StartBarrier(node.others, node.parameters["start_timeout"], now)
        self._next_check = 0.0

    @property
    def waiting(self) -> bool:
        """Whether the node is not connected to its graph yet; a node without named peers belongs to any graph."""
        return not self.ready and bool(self._node.others)

    def partners(self) -> list[tuple[str, Endpoints]]:
        """Return for every stream its topic, its connections, and how many of them the peers make expect."""
        node = self._node
        family = [*node.others, node.kind]
        sides = (node.publishers_by_topic, expected_subscribers), (node.subscriptions_by_topic, expected_publishers)
        return [
            (topic, partners(node, entity, expected(topic, family), family))
            for entities, expected in sides
            for topic, entity in entities.items()
        ]

    def unconnected(self) -> list[str]:
        """Return the topics of the streams that are not connected to all of their partners."""
        return [topic for topic, one in self.partners() if not one.complete]

    def connected(self) -> bool:
        """Whether every stream is connected to all partners that the peers make expect, other nodes aside."""
        return self._match.complete([one for _, one in self.partners()], time.monotonic())

    def announce(self) -> bool:
        """Tell the others once that this node is ready; return whether it is; IdloopError: peers do not appear."""
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
