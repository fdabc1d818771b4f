"""mcap files that no ROS 2 recorder wrote: of ROS 1, of a converter, of a program that names no profile."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from idloop.records.bags.storage.readable_messages import Channel, Message, Plain, mcap_messages

_PROFILE_AT, _ROS2 = 17, b"\x04\x00\x00\x00ros2"  # behind the magic bytes, the kind and the length of the first record


def other_profile(path: Path) -> bool:
    """Whether an mcap file has another profile than that of ROS 2."""
    with path.open("rb") as file:
        begin = file.read(_PROFILE_AT + len(_ROS2))
    return len(begin) == _PROFILE_AT + len(_ROS2) and begin[_PROFILE_AT:] != _ROS2


class StreamedMcap:
    """Such a file, read from its beginning to its end; what is no message of ROS in it is passed over.

    Raises ValueError: the file is cut off or damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.connections: list[Any] = []

    def open(self) -> None:
        """Find the topics, and count their messages."""
        from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

        counts: Counter[Channel] = Counter(message.channel for message in self._all())
        self.connections = [
            SimpleNamespace(
                topic=channel.topic,
                msgtype=channel.message_type,
                msgdef=MessageDefinition(MessageDefinitionFormat.MSG, channel.definition),
                msgcount=count,
                channel=channel,
            )
            for channel, count in counts.items()
        ]

    def messages(self, connections: Iterable[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, receive time [ns] and content in CDR, in the order of the file."""
        wanted = {one.channel: one for one in connections}
        for message in self._all():
            if message.channel in wanted:
                yield wanted[message.channel], message.stamp_ns, message.data

    def close(self) -> None:
        """Nothing stays open."""

    def _all(self) -> Iterator[Message]:
        for message in map(Plain(), mcap_messages(self._path)):
            if message is None:
                raise ValueError("the file is cut off or damaged")
            if message.channel.serialization == "cdr":
                yield message
