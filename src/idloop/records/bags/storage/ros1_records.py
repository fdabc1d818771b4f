"""The records of a ROS 1 bag one after the other, without its index, which a crash leaves unwritten.

Format: http://wiki.ros.org/Bags/Format/2.0, little-endian; a record is a head of named fields, then its data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from struct import unpack, unpack_from
from typing import BinaryIO

from idloop.records.bags.bag_limits import limit_bag_readers

_MESSAGE, _CHUNK, _CONNECTION, _CHUNK_INFO = 2, 5, 7, 6
_LONGEST = 1 << 30


@dataclass(frozen=True)
class Ros1Connection:
    """One publisher of a topic: number, topic, type such as ``std_msgs/Float64``, text of the definition."""

    number: int
    topic: str
    message_type: str
    definition: str


@dataclass(frozen=True)
class Ros1Message:
    """One message: number of its connection, receive time [ns], content in the serialisation of ROS 1."""

    connection: int
    stamp_ns: int
    data: bytes


def read_ros1_records(file: Path) -> Iterator[Ros1Connection | Ros1Message | None]:
    """Yield connections and messages in the order of the file, then None where it is cut off or damaged."""
    limit_bag_readers()
    closed = False
    with file.open("rb") as stream:
        try:
            stream.readline(64)
            while (record := _record(stream)) is not None:
                head, data = record
                closed = closed or head["op"][0] == _CHUNK_INFO
                if head["op"][0] != _CHUNK:
                    yield from _content(head, data)
                    continue
                inside = BytesIO(_unpacked(head, data))
                while (record := _record(inside)) is not None:
                    yield from _content(*record)
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            closed = False
    if not closed:
        yield None


def _content(head: dict[str, bytes], data: bytes) -> Iterator[Ros1Connection | Ros1Message]:
    kind = head["op"][0]
    if kind == _CONNECTION:
        own = _fields(data)
        yield Ros1Connection(
            unpack("<I", head["conn"])[0],
            head["topic"].decode(),
            own["type"].decode(),
            own["message_definition"].decode(errors="replace"),
        )
    elif kind == _MESSAGE:
        seconds, nanoseconds = unpack("<II", head["time"])
        yield Ros1Message(unpack("<I", head["conn"])[0], seconds * 1_000_000_000 + nanoseconds, data)


def _unpacked(head: dict[str, bytes], data: bytes) -> bytes:
    from rosbags.rosbag1 import reader

    return reader.decompressors[head["compression"].decode()](data)


def _record(stream: BinaryIO) -> tuple[dict[str, bytes], bytes] | None:
    """Head and data of the next record; None at the end."""
    begin = stream.read(4)
    if not begin:
        return None
    head = _take(stream, unpack("<I", begin)[0])
    return _fields(head), _take(stream, unpack("<I", _take(stream, 4))[0])


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
