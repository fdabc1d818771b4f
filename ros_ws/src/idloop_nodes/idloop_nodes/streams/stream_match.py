"""Whether publishers and subscriptions match: by quality of service, and with all partners of a graph."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind

from idloop_nodes.codec import Level, Status
from idloop_nodes.codec.diagnostics import absolute_name

RENAMED = 10.0  # seconds for which everything known is matched before partners that go by other names are taken for met

CHECK = "quality of service"


@dataclass(frozen=True)
class _Watched:
    """One subscription, and what its user can do for it beside changing the publisher."""

    subscription: Any
    cure: str


class QualityWatch:
    """Compares what subscriptions ask for with what publishers offer, and logs each new mismatch.

    The middleware reports a mismatch when it discovers a publisher, where it can; the graph tells which publisher it
    is, and when it is mended.
    """

    def __init__(self, node: Any, log: Callable[[str], object]) -> None:
        self._node = node
        self._log = log
        self._watched: dict[str, _Watched] = {}
        self._reported: dict[str, str] = {}  # topic: policy, told by the middleware and not yet seen in the graph
        self._lines: list[str] = []
        self._ever = False

    def callbacks(self, topic: str, **others: Any) -> SubscriptionEventCallbacks:
        """Return the event callbacks of a new subscription, as `watch` will know it; `others`: further callbacks."""

        def incompatible(event: Any) -> None:
            self._reported[topic] = qos_policy_name_from_kind(event.last_policy_kind).lower()
            self.check()

        return SubscriptionEventCallbacks(incompatible_qos=incompatible, **others)

    def watch(self, topic: str, subscription: Any, cure: str = "") -> None:
        """Watch a subscription; `cure` is what else helps than another publisher, such as a parameter of this node."""
        self._watched[topic] = _Watched(subscription, cure)

    def check(self) -> None:
        """Look at the graph, and log what is new."""
        lines = [line for topic, one in self._watched.items() for line in self._mismatches(topic, one)]
        for line in lines:
            if line not in self._lines:
                self._log(line)
        self._lines = lines
        self._ever = self._ever or bool(lines)

    def status(self) -> list[Status]:
        """Return the check for diagnostics: none as long as there was never a mismatch."""
        if not self._ever:
            return []
        if self._lines:
            return [Status(CHECK, "; ".join(self._lines), Level.WARN)]
        return [Status(CHECK, "publishers and subscriptions match", Level.OK)]

    def _mismatches(self, topic: str, watched: _Watched) -> Iterable[str]:
        subscription = watched.subscription
        publishers = self._node.get_publishers_info_by_topic(subscription.topic_name)
        if publishers:
            self._reported.pop(topic, None)
        elif topic in self._reported:
            yield (
                f"{subscription.topic_name}: nothing arrives from a publisher whose {self._reported[topic]} does not"
                f" satisfy this subscription{_advice(watched.cure)}"
            )
        for one in publishers:
            found = mismatch(one.qos_profile, subscription.qos_profile)
            if found:
                name = absolute_name(one.node_namespace, one.node_name)
                yield (
                    f"{subscription.topic_name}: nothing arrives from {name}, {found[0]}"
                    f"{_advice(watched.cure if found[1] == 'reliable' else '', found[1])}"
                )


def _advice(cure: str, wanted: str = "") -> str:
    ways = [one for one in (cure, f"publish it {wanted}" if wanted else "") if one]
    return f": {', or '.join(ways)}" if ways else ""


def mismatch(offered: QoSProfile, wanted: QoSProfile) -> tuple[str, str] | None:
    """Return how an offer falls short of what is asked for, and what should be offered; None where it suffices."""
    # Not by `qos_check_compatible`: it takes the deadline that discovery leaves at zero for one that was asked for.
    best_effort = offered.reliability == ReliabilityPolicy.BEST_EFFORT
    volatile = offered.durability == DurabilityPolicy.VOLATILE
    if best_effort and wanted.reliability == ReliabilityPolicy.RELIABLE:
        return "it publishes best effort and reliable is asked for", "reliable"
    if volatile and wanted.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return "it publishes volatile and transient local is asked for", "transient local"
    return None


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


def partners(node: Any, entity: Any, expected: int, family: Collection[str]) -> Endpoints:
    """Look at who subscribes what a publisher of a node publishes, or who publishes what a subscription subscribes.

    `expected`: how many of the graph's own nodes belong there; `family`: their names.
    """
    package, kind, *_ = entity.msg_type.__module__.split(".")
    type_name = f"{package}/{kind}/{entity.msg_type.__name__}"
    publishes = hasattr(entity, "get_subscription_count")
    look = node.get_subscriptions_info_by_topic if publishes else node.get_publishers_info_by_topic
    matched = entity.get_subscription_count() if publishes else entity.get_publisher_count()
    known = []
    for one in look(entity.topic_name):
        offered, wanted = (entity, one) if publishes else (one, entity)
        if one.topic_type == type_name and mismatch(offered.qos_profile, wanted.qos_profile) is None:
            known.append(one)
    own = sum(one.node_name in family and one.node_namespace == node.get_namespace() for one in known)
    return Endpoints(expected, own, len(known), matched)


class StreamMatch:
    """Whether all streams of a node are connected; nodes with other names cost a waiting time."""

    def __init__(self) -> None:
        self._connected_since: float | None = None

    def complete(self, streams: Iterable[Endpoints], now: float) -> bool:
        """Whether all partners of a node's streams are connected at the steady time `now` [s]."""
        streams = list(streams)
        if not all(one.connected for one in streams):
            self._connected_since = None
            return False
        if self._connected_since is None:
            self._connected_since = now
        return all(one.complete for one in streams) or now - self._connected_since >= RENAMED
