"""The messages of a storage file that can still be read, whole or cut off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.records.bags.bag_limits import limit_bag_readers, unpack_message
from idloop.records.bags.storage.cut_chunk import cut_chunk_records
from idloop.records.bags.storage.ros1_records import Ros1Connection, read_ros1_records
from idloop.records.bags.storage.ros1_types import ros1_typestore
from idloop.records.bags.storage.sqlite_pages import SqlitePages
from idloop.records.bags.storage.storage_files import file_format
from idloop.records.bags.storage.unpacking import Scratch, unpack_file

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

ROS1 = "ros1"  # serialisation
_SQLITE_MESSAGE = (type(None), int, int, bytes)  # id (it is the row's), topic, time, content


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


def mcap_messages(file: Path) -> Iterator[Message | None]:
    """Yield the messages of an mcap file in its order, then None where the file was cut.

    Of a chunk that was cut the messages before the cut are read as well: a file may have one chunk only.
    """
    from mcap import records
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    schemas: dict[int, records.Schema] = {}
    channels: dict[int, Channel] = {}
    foreign: set[int] = set()  # channels without a schema: no messages of ROS
    whole = False

    def messages(found: Iterable[Any]) -> Iterator[Message]:
        nonlocal whole
        for record in found:
            whole = whole or isinstance(record, records.Footer)
            if isinstance(record, records.Schema):
                schemas[record.id] = record
            elif isinstance(record, records.Channel) and not record.schema_id:
                foreign.add(record.id)
            elif isinstance(record, records.Channel):
                schema = schemas[record.schema_id]
                channels[record.id] = Channel(
                    topic=record.topic,
                    message_type=schema.name,
                    definition=schema.data.decode(),
                    type_hash=record.metadata.get("topic_type_hash", ""),
                    serialization=record.message_encoding,
                )
            elif isinstance(record, records.Message) and record.channel_id not in foreign:
                yield Message(channels[record.channel_id], record.log_time, record.data)

    with file.open("rb") as stream:
        try:
            yield from messages(StreamReader(stream).records)
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            whole = False
    if not whole:
        with suppress(Exception):
            yield from messages(cut_chunk_records(file))
        yield None


def sqlite_messages(file: Path) -> Iterator[Message | None]:
    """Yield every whole message of a rosbag2 SQLite file in the order of recording, then None where the file was cut.

    In a cut file the tree of a table refers to pages behind the cut, so all pages that are left are searched.
    """
    whole = False
    try:
        with file.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
            pages = SqlitePages(data)
            whole = pages.whole
            channels = _sqlite_channels(pages)
            found: dict[int, int] = {}
            for number in pages.leaves():
                for row, values in pages.leaf(number):
                    if tuple(map(type, values)) == _SQLITE_MESSAGE and values[1] in channels:
                        found.setdefault(row, number)
            # Pages are read again in the order of recording, so that memory holds the content of one at a time.
            at, rows = 0, {}
            for row in sorted(found):
                if found[row] != at:
                    at = found[row]
                    rows = dict(pages.leaf(at))
                _, topic, stamp, content = rows[row]
                yield Message(channels[topic], stamp, content)
    except ValueError:  # an empty file, or no SQLite file
        whole = False
    if not whole:
        yield None


def _sqlite_channels(pages: SqlitePages) -> dict[int, Channel]:
    """Topics by their number, with the definitions of their messages where the recorder wrote them."""
    definitions = {
        row["topic_type"]: row["encoded_message_definition"]
        for _, row in pages.named_rows("message_definitions")
        if row.get("encoding") == "ros2msg" and {"topic_type", "encoded_message_definition"} <= row.keys()
    }
    return {
        number: Channel(
            topic=row["name"],
            message_type=row["type"],
            definition=definitions.get(row["type"], ""),
            type_hash=row.get("type_description_hash") or "",
            serialization=row["serialization_format"],
        )
        for number, row in pages.named_rows("topics")
        if all(isinstance(row.get(key), str) for key in ("name", "type", "serialization_format"))
    }


def ros1_messages(file: Path) -> Iterator[Message | None]:
    """Yield the messages of a ROS 1 bag as messages of ROS 2, and None where one is damaged or the file was cut."""
    channels: dict[int, Channel] = {}
    for record in read_ros1_records(file):
        if isinstance(record, Ros1Connection):
            channels[record.number] = Channel(record.topic, record.message_type, record.definition, "", ROS1)
        elif record is None or record.connection not in channels:
            yield None
        else:
            yield Message(channels[record.connection], record.stamp_ns, record.data)


def readable_messages(file: Path, scratch: Scratch) -> Iterator[Message | None]:
    """Yield every message of a storage file that can be read, and None wherever something is damaged.

    `file`: mcap, sqlite3 or ROS 1, packed or not.
    `scratch`: for unpacked files.
    """
    kind, whole = file_format(file), True
    if kind == "zstd":
        file, whole = unpack_file(file, scratch, keep_cut=True)
        kind = file_format(file)
    if kind in _READERS:
        yield from map(Plain(), _READERS[kind](file))
    if not whole or kind not in _READERS:
        yield None


class Plain:
    """Turns messages into CDR, as they were published: unpacks those packed one by one, converts those of ROS 1."""

    def __init__(self) -> None:
        self._converted: dict[Channel, tuple[Channel, Typestore]] = {}

    def __call__(self, message: Message | None) -> Message | None:
        """Return the message, or None where it is damaged."""
        if message is None:
            return None
        try:
            if message.channel.serialization != ROS1:
                return replace(message, data=unpack_message(message.data))
            channel, store = self._ros2(message.channel)
            return Message(channel, message.stamp_ns, bytes(store.ros1_to_cdr(message.data, channel.message_type)))
        except Exception:  # noqa: BLE001 - the bytes may be anything
            return None

    def _ros2(self, channel: Channel) -> tuple[Channel, Typestore]:
        if channel not in self._converted:
            name, store = ros1_typestore(channel.message_type, channel.definition)
            definition, _ = store.generate_msgdef(name, ros_version=2)
            self._converted[channel] = Channel(channel.topic, name, definition, store.hash_rihs01(name), "cdr"), store
        return self._converted[channel]


_READERS = {"mcap": mcap_messages, "sqlite3": sqlite_messages, "ros1": ros1_messages}
