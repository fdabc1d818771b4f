"""The messages of a storage file that can still be read, whole or cut off."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from idloop.records.bags.storage.message import ROS1, Channel, Message
from idloop.records.bags.storage.ros1 import ros1_messages, ros1_typestore
from idloop.records.bags.storage.sqlite_pages import SqlitePages
from idloop.records.bags.storage.storage_files import file_format
from idloop.records.bags.storage.unpacking import (
    MOST_UNPACKED,
    Scratch,
    limit_bag_readers,
    unpack_beginning,
    unpack_file,
    unpack_message,
)

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_SQLITE_MESSAGE = (type(None), int, int, bytes)  # id (it is the row's), topic, time, content
# Of an mcap file: bytes of its magic; kind and length of a record; first and last stamp, size and checksum, and length
# of the name of the compression of a chunk; size of its records.
_MAGIC, _RECORD, _CHUNK, _LENGTH = 8, struct.Struct("<BQ"), struct.Struct("<QQQII"), struct.Struct("<Q")
_IS_CHUNK = 0x06


def mcap_messages(file: Path) -> Iterator[Message | None]:
    """Yield the messages of an mcap file in its order, then None where the file was cut.

    Of a chunk that was cut the messages before the cut are read as well: a file may have one chunk only.
    """
    from mcap import records
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    schemas: dict[int, Any] = {}
    channels: dict[int, Channel | None] = {}  # None without a schema: no messages of ROS
    whole = False

    def messages(found: Iterator[Any]) -> Iterator[Message]:
        nonlocal whole
        for record in found:
            whole = whole or isinstance(record, records.Footer)
            if isinstance(record, records.Schema):
                schemas[record.id] = record
            elif isinstance(record, records.Channel):
                schema, type_hash = schemas.get(record.schema_id), record.metadata.get("topic_type_hash", "")
                channels[record.id] = schema and Channel(
                    record.topic, schema.name, schema.data.decode(), type_hash, record.message_encoding
                )
            elif isinstance(record, records.Message) and (channel := channels[record.channel_id]) is not None:
                yield Message(channel, record.log_time, record.data)

    with file.open("rb") as stream:
        try:
            yield from messages(StreamReader(stream).records)
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            whole = False
    if not whole:
        with suppress(Exception):
            yield from messages(cut_chunk_records(file))
        yield None


def cut_chunk_records(file: Path) -> Iterator[Any]:
    """Yield the whole records of the chunk with which a cut mcap file ends; nothing where it ends otherwise.

    A compressed chunk gives what its whole blocks hold.
    """
    from mcap.stream_reader import StreamReader

    with file.open("rb") as stream:
        chunk = _last_chunk(stream, file.stat().st_size)
    # Records come one at a time: the last one is cut, and ends the file with an error.
    with suppress(Exception):
        *_, length = _CHUNK.unpack_from(chunk)
        compression = chunk[_CHUNK.size : _CHUNK.size + length].decode()
        content = unpack_beginning(chunk[_CHUNK.size + length + _LENGTH.size :], compression)
        yield from StreamReader(BytesIO(content), skip_magic=True).records


def _last_chunk(stream: BinaryIO, size: int) -> bytes:
    """Content of the last record, where it is a chunk and longer than what is left of the file."""
    place = _MAGIC
    while place + _RECORD.size <= size:
        stream.seek(place)
        kind, length = _RECORD.unpack(stream.read(_RECORD.size))
        place += _RECORD.size + length
        if place > size:
            return stream.read(MOST_UNPACKED) if kind == _IS_CHUNK else b""
    return b""


def sqlite_messages(file: Path) -> Iterator[Message | None]:
    """Yield every whole message of a rosbag2 SQLite file in the order of recording, then None where the file was cut.

    In a cut file the tree of a table refers to pages behind the cut, so all pages that are left are searched.
    """
    whole = False
    # An empty file, or no SQLite file, is a ValueError.
    with suppress(ValueError), file.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        pages = SqlitePages(data)
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
        whole = pages.whole
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
