"""An mcap file, written record by record: what the package mcap does, at a fifth of its time for each message.

The format: https://mcap.dev/spec. Schemas and channels lie in the first chunk and again in the summary; nothing is
compressed.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from typing import Protocol

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F

_MESSAGE = struct.Struct("<BQHIQQ")  # operation, length, channel, sequence, log and publish time
_AFTER_LENGTH = _MESSAGE.size - 9  # bytes of a message's record before its payload


class Sink(Protocol):
    """Where the bytes go."""

    def write(self, data: bytes) -> int:
        """Take all of them."""

    def tell(self) -> int:
        """Say how many it has."""


def _record(operation: int, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack("<BQ", operation, len(content)) + content


def _text(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _mapping(form: str, items: Iterable[tuple[int, int]]) -> bytes:
    content = b"".join(struct.pack(form, *item) for item in items)
    return struct.pack("<I", len(content)) + content


class McapFile:
    """Writes messages to a sink, in chunks of a size in bytes, with indexes."""

    def __init__(self, sink: Sink, chunk_size: int, library: str) -> None:
        self._sink = sink
        self._chunk_size = chunk_size
        self._records = bytearray()
        self._start = self._end = 0
        self._indexes: dict[int, list[int]] = {}  # channel: time and place of each message of the chunk, in turn
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunks: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._first = self._last = 0
        sink.write(MAGIC + _record(HEADER, _text("ros2"), _text(library)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Describe a type of message; return its number."""
        number = len(self._schemas) + 1
        content = struct.pack("<H", number) + _text(name) + _text(encoding) + struct.pack("<I", len(data)) + data
        self._schemas.append(_record(SCHEMA, content))
        self._records += self._schemas[-1]
        return number

    def add_channel(self, topic: str, encoding: str, schema: int, metadata: dict[str, str]) -> int:
        """Describe a topic; return its number."""
        number = len(self._channels) + 1
        pairs = b"".join(_text(key) + _text(value) for key, value in metadata.items())
        content = struct.pack("<HH", number, schema) + _text(topic) + _text(encoding) + struct.pack("<I", len(pairs))
        self._channels.append(_record(CHANNEL, content, pairs))
        self._records += self._channels[-1]
        return number

    def add_message(self, channel: int, log_time: int, data: bytes, sequence: int = 0) -> None:
        """Append one message of a channel; its time [ns] counts for its publication as well."""
        records = self._records
        if not self._indexes:
            self._start = self._end = log_time
        elif log_time < self._start:
            self._start = log_time
        elif log_time > self._end:
            self._end = log_time
        index = self._indexes.get(channel)
        if index is None:
            index = self._indexes[channel] = []
        index += (log_time, len(records))
        records += _MESSAGE.pack(MESSAGE, _AFTER_LENGTH + len(data), channel, sequence, log_time, log_time)
        records += data
        if len(records) > self._chunk_size:
            self._put_chunk()

    def _put_chunk(self) -> None:
        if not self._indexes:
            return
        records, size = bytes(self._records), len(self._records)
        times, place = struct.pack("<QQ", self._start, self._end), self._sink.tell()
        check = struct.pack("<QI", size, zlib.crc32(records))
        self._sink.write(_record(CHUNK, times, check, _text(""), struct.pack("<Q", size), records))
        begin, indexes = self._sink.tell(), b""
        places = []
        for channel, index in self._indexes.items():
            places.append((channel, begin + len(indexes)))
            content = struct.pack(f"<HI{len(index)}Q", channel, 8 * len(index), *index)
            indexes += _record(MESSAGE_INDEX, content)
            self._counts[channel] = self._counts.get(channel, 0) + len(index) // 2
        self._sink.write(indexes)
        self._first = min(self._first, self._start) if self._chunks else self._start
        self._last = max(self._last, self._end)
        self._chunks.append(
            _record(
                CHUNK_INDEX,
                times,
                struct.pack("<QQ", place, begin - place),
                _mapping("<HQ", places),
                struct.pack("<Q", len(indexes)),
                _text(""),
                struct.pack("<QQ", size, size),
            )
        )
        self._records = bytearray()
        self._indexes = {}

    def finish(self) -> None:
        """Write the last chunk and the summary."""
        self._put_chunk()
        self._sink.write(_record(DATA_END, struct.pack("<I", 0)))
        counts = (len(self._schemas), len(self._channels), 0, 0, len(self._chunks))
        statistics = _record(
            STATISTICS,
            struct.pack("<QHIIII", sum(self._counts.values()), *counts),
            struct.pack("<QQ", self._first, self._last),
            _mapping("<HQ", self._counts.items()),
        )
        groups = ((SCHEMA, self._schemas), (CHANNEL, self._channels), (STATISTICS, [statistics]))
        start, summary, offsets = self._sink.tell(), b"", b""
        for operation, records in (*groups, (CHUNK_INDEX, self._chunks)):
            group = b"".join(records)
            offsets += _record(SUMMARY_OFFSET, struct.pack("<BQQ", operation, start + len(summary), len(group)))
            summary += group
        places = struct.pack("<QQ", start, start + len(summary))
        summary += offsets
        head = struct.pack("<BQ", FOOTER, 20) + places
        check = zlib.crc32(head, zlib.crc32(summary))
        self._sink.write(summary + head + struct.pack("<I", check) + MAGIC)
