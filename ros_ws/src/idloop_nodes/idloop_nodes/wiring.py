"""Which node publishes and subscribes which stream in a graph: for the start barrier."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from idloop.records.bags.topics import APPLIED_COMMAND, REQUESTED_COMMAND
from idloop_nodes.descriptions import KINDS, describe


def command_topic(topic: str, family: Iterable[str]) -> str:
    """Return the topic of the commands that a machine received: behind a bridge the applied command, after all limits.

    `topic`: of the command, as the model names it; `family`: kinds of the nodes of the graph.
    """
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
