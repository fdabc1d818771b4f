"""One storage file of a bag, open for reading: mcap and sqlite3 of ROS 2, and the bags of ROS 1."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.storage.message import Channel, Message
from idloop.records.bags.storage.readable_messages import Plain, mcap_messages
from idloop.records.bags.storage.storage_files import file_format
from idloop.records.bags.storage.unpacking import Scratch, limit_bag_readers, unpack_file, unpack_message

_PROFILE_AT, _ROS2 = 17, b"\x04\x00\x00\x00ros2"  # behind the magic bytes, the kind and the length of the first record


class StorageFile:
    """A storage file; one that is packed as a whole, or whose messages are packed one by one, is unpacked.

    `scratch`: for unpacked files.
    Raises InputError: empty, of no known format, or not to be unpacked.
    Raises Exception: any, of the reader, for a damaged file.
    """

    connections: list[Any]  # topics as rosbags has them: ``topic``, ``msgtype``, ``msgdef``, ``msgcount``
    ros1: bool  # whether messages are in the serialisation of ROS 1

    def __init__(self, path: Path, scratch: Scratch) -> None:
        from rosbags.rosbag1 import Reader as Ros1Reader
        from rosbags.rosbag2.storage_mcap import McapReader
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

        limit_bag_readers()
        self.path = path
        kind = file_format(path)
        if kind == "zstd":
            path, _ = unpack_file(path, scratch)
            kind = file_format(path)
        if kind is None or kind == "zstd":
            raise InputError(f"{self.path}: holds no recording (.mcap, .db3 or .bag); name the recording")
        self.ros1 = kind == "ros1"
        reader: Any = {"mcap": McapReader, "sqlite3": Sqlite3Reader, "ros1": Ros1Reader}[kind]
        self._reader = (_StreamedMcap if kind == "mcap" and _other_profile(path) else reader)(path)
        self._reader.open()
        self.connections = list(self._reader.connections)

    def messages(self, connections: Iterable[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, receive time [ns] and content."""
        for connection, stamp, data in self._reader.messages(list(connections)):
            yield connection, stamp, bytes(data) if self.ros1 else unpack_message(data)

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


def _other_profile(path: Path) -> bool:
    """Whether an mcap file has another profile than that of ROS 2."""
    with path.open("rb") as file:
        begin = file.read(_PROFILE_AT + len(_ROS2))
    return len(begin) == _PROFILE_AT + len(_ROS2) and begin[_PROFILE_AT:] != _ROS2


class _StreamedMcap:
    """An mcap file that no ROS 2 recorder wrote: of ROS 1, of a converter, of a program that names no profile.

    It is read from its beginning to its end; what is no message of ROS in it is passed over.

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
