"""ROS 1: the messages of a bag without its index, which a crash leaves unwritten, and message types as those of ROS 2.

Format: http://wiki.ros.org/Bags/Format/2.0, little-endian; a record is a head of named fields, then its data.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from struct import unpack, unpack_from
from typing import TYPE_CHECKING, Any, BinaryIO

from idloop.records.bags.storage.message import ROS1, Channel, Message
from idloop.records.bags.storage.unpacking import limit_bag_readers

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_MESSAGE, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 5, 6, 7
_LONGEST = 1 << 30
# Types that ROS 2 has its own of: the conversion to CDR passes over the sequence number of a header of ROS 1.
_OWN = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


def ros1_messages(file: Path) -> Iterator[Message | None]:
    """Yield the messages of a bag in its order, and None where one is damaged or the file was cut."""
    limit_bag_readers()
    channels: dict[int, Channel] = {}
    closed = False
    with file.open("rb") as stream:
        try:
            stream.readline(64)
            for head, data in _records(stream):
                kind = head["op"][0]
                closed = closed or kind == _CHUNK_INFO
                if kind == _CONNECTION:
                    own = _fields(data)
                    definition = own["message_definition"].decode(errors="replace")
                    channel = Channel(head["topic"].decode(), own["type"].decode(), definition, "", ROS1)
                    channels[unpack("<I", head["conn"])[0]] = channel
                elif kind == _MESSAGE:
                    seconds, nanoseconds = unpack("<II", head["time"])
                    sender = channels.get(unpack("<I", head["conn"])[0])
                    yield Message(sender, seconds * 1_000_000_000 + nanoseconds, data) if sender else None
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            closed = False
    if not closed:
        yield None


def _records(stream: BinaryIO) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Yield head and data of the records, those of a chunk in its place."""
    from rosbags.rosbag1 import reader

    while begin := stream.read(4):
        head = _fields(_take(stream, unpack("<I", begin)[0]))
        data = _take(stream, unpack("<I", _take(stream, 4))[0])
        if head["op"][0] == _CHUNK:
            yield from _records(BytesIO(reader.decompressors[head["compression"].decode()](data)))
        else:
            yield head, data


def _take(stream: BinaryIO, size: int) -> bytes:
    data = stream.read(min(size, _LONGEST))
    if len(data) != size:
        raise ValueError("the file ends within a record")
    return data


def _fields(head: bytes) -> dict[str, bytes]:
    found, at = {}, 0
    while at < len(head):
        size = unpack_from("<I", head, at)[0]
        name, _, value = head[at + 4 : at + 4 + size].partition(b"=")
        found[name.decode()] = value
        at += 4 + size
    return found


def ros2_types(types: dict[str, Any]) -> dict[str, Any]:
    """Return the types of a definition of ROS 1 without those that ROS 2 has its own of."""
    return {name: fields for name, fields in types.items() if name not in _OWN}


def ros1_typestore(message_type: str, definition: str) -> tuple[str, Typestore]:
    """Return the name that a type has in ROS 2, and a store that knows it.

    Raises Exception: any, where the definition cannot be parsed.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    name = normalize_msgtype(message_type)
    store = get_typestore(Stores.EMPTY)
    own = ros2_types(dict(get_types_from_msg(definition, name)))
    store.register({**get_typestore(Stores.LATEST).fielddefs, **own})
    return name, store
