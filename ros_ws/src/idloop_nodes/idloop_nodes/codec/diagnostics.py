"""diagnostic_msgs/DiagnosticArray: bytes to statuses and back, and the names of checks on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from idloop.records.bags.cdr import CdrError, CdrReader, CdrWriter


class Level(IntEnum):
    """Levels of a DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One diagnostic_msgs/DiagnosticStatus."""

    name: str  # ``node: check``
    message: str = ""  # one line a person reads
    level: Level = Level.OK  # how bad it is
    values: dict[str, str] = field(default_factory=dict)  # key values, in order
    hardware_id: str = ""  # what the status is about


def encode_diagnostics(stamp_ns: int, statuses: Sequence[Status]) -> bytes:
    """Return a DiagnosticArray as bytes."""
    writer = CdrWriter()
    writer.stamp(stamp_ns)
    writer.string("")  # frame
    writer.uint32(len(statuses))
    for status in statuses:
        writer.uint8(int(status.level))
        writer.string(status.name)
        writer.string(status.message)
        writer.string(status.hardware_id)
        writer.uint32(len(status.values))
        for key, value in status.values.items():
            writer.string(key)
            writer.string(value)
    return writer.finish()


def decode_diagnostics(data: bytes) -> tuple[int, list[Status]]:
    """Return stamp in nanoseconds and statuses of a DiagnosticArray; CdrError when it is none."""
    reader = CdrReader(data)
    stamp, _ = reader.stamp(), reader.string()
    statuses = []
    for _ in range(reader.count()):
        level = reader.uint8()
        if level not in tuple(Level):
            raise CdrError(f"{level} is no diagnostic level")
        name, message, hardware = reader.string(), reader.string(), reader.string()
        values = {reader.string(): reader.string() for _ in range(reader.count())}
        statuses.append(Status(name, message, Level(level), values, hardware))
    return stamp, statuses


def check_name(namespace: str, node: str, check: str) -> str:
    """Return the name under which a node publishes a check: ``left/controller: safety``."""
    return f"{absolute_name(namespace, node)[1:]}: {check}"


def seen_from(namespace: str, name: str) -> tuple[str, str]:
    """Return node and check of a published name; nodes of the reader's namespace without it, others from the root."""
    node, _, check = name.partition(": ")
    return node_seen_from(namespace, f"/{node.lstrip('/')}"), check  # some publish it with the slash


def node_seen_from(namespace: str, node: str) -> str:
    """Return the shortest name of a node: without the namespace where it is the reader's own."""
    own = absolute_name(namespace, "")
    absolute = absolute_name(namespace, node)
    return absolute.removeprefix(own) if absolute.startswith(own) else absolute


def absolute_name(namespace: str, node: str) -> str:
    """Return the fully qualified name of a node, which may be that already."""
    return node if node.startswith("/") else f"{namespace.rstrip('/')}/{node}"
