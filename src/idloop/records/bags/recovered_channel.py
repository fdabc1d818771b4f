"""What a message needs to be written again, whatever file it was saved from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RecoveredChannel:
    """One topic of a recording.

    Attributes
    ----------
    topic, message_type : str
    definition : str
        The message's definition in ROS 2's own language; empty when the recording does not tell it.
    type_hash : str
        REP-2011 hash of the type; empty when the recording does not tell it.
    serialization : str
        Usually ``cdr``.
    """

    topic: str
    message_type: str
    definition: str
    type_hash: str
    serialization: str


@dataclass(frozen=True)
class RecoveredMessage:
    """One message: its topic, the recorder's time [ns] and its bytes."""

    channel: RecoveredChannel
    stamp_ns: int
    data: bytes
