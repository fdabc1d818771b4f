"""One message of a recording, and its topic."""

from __future__ import annotations

from dataclasses import dataclass

ROS1 = "ros1"  # serialisation


@dataclass(frozen=True)
class Channel:
    """One topic of a recording."""

    topic: str
    message_type: str
    # Text of the message's definition and REP-2011 hash of the type; empty where the recording has none
    definition: str
    type_hash: str
    serialization: str  # usually ``cdr``


@dataclass(frozen=True)
class Message:
    """One message: its topic, the time at which the recorder received it [ns], and its bytes."""

    channel: Channel
    stamp_ns: int
    data: bytes
