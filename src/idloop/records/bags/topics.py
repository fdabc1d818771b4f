"""Which topic of a bag is which: relative names, topics beside the command, the command that the drive applied."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from idloop.errors import InputError
from idloop.records.bags.stream import JOINT_STATE
from idloop.records.finding import Finding
from idloop.spelling import did_you_mean, listed

# The command that a controller requests, and what a bridge passed on to the drive within its limits. The motion follows
# the second.
REQUESTED_COMMAND, APPLIED_COMMAND = "joint_command", "bridge/command"


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: name, message type, number of messages."""

    name: str
    type: str
    count: int


def topics_named(name: str, topics: Iterable[str]) -> list[str]:
    """Return what a relative name may mean: the exact topic, that in the root namespace, or all that end with it."""
    known = list(topics)
    for candidate in (name, "/" + name.lstrip("/")):
        if candidate in known:
            return [candidate]
    return [topic for topic in known if topic.endswith("/" + name.lstrip("/"))]


def resolve_topic(name: str, topics: Iterable[str], where: Path | str) -> str:
    """Return the topic of a bag that a model's relative topic name means.

    An exact name wins, then the name in the root namespace, then a single topic that ends with it.

    Raises InputError: unknown topic, or several namespaces that hold it.
    """
    known = list(topics)
    inside = topics_named(name, known)
    if len(inside) > 1:
        raise InputError(
            f"{where}: topic {name!r} exists in several namespaces ({listed(inside)}); write the full name in the"
            " model file"
        )
    if not inside:
        near = did_you_mean(name.lstrip("/"), [topic.lstrip("/") for topic in known])
        raise InputError(f"{where}: no topic {name!r}; the bag has {listed(known)}{near}")
    return inside[0]


def topic_beside(command: str, other: str, topics: Collection[str]) -> str:
    """Return the topic `other` beside the command, or at the root beside a controller's own command topic."""
    folder, _, name = command.rpartition("/")
    beside = f"{folder}/{other}"
    return beside if beside in topics or name == REQUESTED_COMMAND else f"/{other}"


def applied_command_topic(command: str, topics: Mapping[str, Topic]) -> str:
    """Topic of the command that the drive applied.

    `command`: topic of the requested command.
    `topics`: all topics of the recording.
    Returns: the command of a bridge beside a `joint_command`, where joint states were recorded on it; else `command`.
    """
    folder, _, name = command.rpartition("/")
    applied = topics.get(f"{folder}/{APPLIED_COMMAND}") if name == REQUESTED_COMMAND else None
    return applied.name if applied is not None and applied.count and applied.type == JOINT_STATE else command


def applied_command_findings(requested: str, applied: str) -> list[Finding]:
    """Say which of the two commands is used, where there are two."""
    if requested == applied:
        return []
    text = f"the command is {applied}, which the drive applied, not {requested}, which the controller requested"
    return [Finding("told", text, where=applied)]
