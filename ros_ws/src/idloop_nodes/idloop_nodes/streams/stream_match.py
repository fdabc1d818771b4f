"""Whether streams are connected to all of their partners, other nodes aside.

A count alone is not enough: a plotter that is connected can take the place of the controller, whose reader is not
connected yet. The first sample would be lost to it, and in lock-step both would then wait for ever.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

from idloop_nodes.streams.quality_watch import mismatch

RENAMED = 10.0  # seconds for which everything known is matched before partners that go by other names are taken for met


@dataclass(frozen=True)
class Endpoints:
    """The other side of one stream."""

    expected: int  # how many of the graph's own nodes belong there
    own: int  # how many of them are known
    known: int  # how many there are, strangers among them
    matched: int  # how many of these are connected with this node

    @property
    def connected(self) -> bool:
        """Whether all known endpoints are connected, and there are enough."""
        return self.matched >= max(self.expected, self.known)

    @property
    def complete(self) -> bool:
        """Whether every one of the graph's own nodes is among them."""
        return self.connected and self.own >= self.expected


def subscribers(node: Any, publisher: Any, expected: int, family: Collection[str]) -> Endpoints:
    """Look at who subscribes what `publisher` of `node` publishes; `family` are the names of the graph's nodes."""
    known = [
        one
        for one in node.get_subscriptions_info_by_topic(publisher.topic_name)
        if mismatch(publisher.qos_profile, one.qos_profile) is None and one.topic_type == _type_name(publisher)
    ]
    return Endpoints(expected, _own(node, known, family), len(known), publisher.get_subscription_count())


def publishers(node: Any, subscription: Any, expected: int, family: Collection[str]) -> Endpoints:
    """Look at who publishes what `subscription` of `node` subscribes; `family` are the names of the graph's nodes."""
    known = [
        one
        for one in node.get_publishers_info_by_topic(subscription.topic_name)
        if mismatch(one.qos_profile, subscription.qos_profile) is None and one.topic_type == _type_name(subscription)
    ]
    return Endpoints(expected, _own(node, known, family), len(known), subscription.get_publisher_count())


def _type_name(entity: Any) -> str:
    package, kind, *_ = entity.msg_type.__module__.split(".")
    return f"{package}/{kind}/{entity.msg_type.__name__}"


def _own(node: Any, known: Iterable[Any], family: Collection[str]) -> int:
    where = node.get_namespace()
    return sum(one.node_name in family and one.node_namespace == where for one in known)


class StreamMatch:
    """Whether all streams of a node are connected; nodes with other names cost a waiting time."""

    def __init__(self) -> None:
        self._connected_since: float | None = None

    def complete(self, streams: Iterable[Endpoints], now: float) -> bool:
        """Whether all partners are connected.

        `streams`: of one node, as they are now; `now`: of a clock that never jumps [s].
        """
        streams = list(streams)
        if not all(one.connected for one in streams):
            self._connected_since = None
            return False
        if self._connected_since is None:
            self._connected_since = now
        return all(one.complete for one in streams) or now - self._connected_since >= RENAMED
