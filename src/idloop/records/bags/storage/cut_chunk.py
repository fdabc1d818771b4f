"""The records at the beginning of an mcap chunk that was not written to its end."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from idloop.records.bags.bag_limits import MOST_UNPACKED, unpack_beginning

_MAGIC = 8
_RECORD = struct.Struct("<BQ")  # kind and length
_CHUNK = 0x06
_HEADER = struct.Struct("<QQQI")  # first and last stamp, size, checksum
_LENGTH = struct.Struct("<Q")
_TEXT = struct.Struct("<I")


def cut_chunk_records(file: Path) -> Iterator[Any]:
    """Yield the whole records of the chunk with which a cut mcap file ends; nothing where it ends otherwise.

    A compressed chunk gives what its whole blocks hold.
    """
    from mcap.stream_reader import StreamReader

    with file.open("rb") as stream:
        content = _last_chunk(stream, file.stat().st_size)
    try:
        # Records come one at a time: the last one is cut, and ends the file with an error.
        yield from StreamReader(BytesIO(_unpacked(content)), skip_magic=True).records
    except Exception:  # noqa: BLE001 - the cut may fall anywhere
        return


def _last_chunk(stream: BinaryIO, size: int) -> bytes:
    """Content of the last record, where it is a chunk and longer than what is left of the file."""
    place = _MAGIC
    while place + _RECORD.size <= size:
        stream.seek(place)
        kind, length = _RECORD.unpack(stream.read(_RECORD.size))
        place += _RECORD.size + length
        if place > size:
            return stream.read(MOST_UNPACKED) if kind == _CHUNK else b""
    return b""


def _unpacked(chunk: bytes) -> bytes:
    """Records of a chunk, as far as they can be unpacked."""
    (length,) = _TEXT.unpack_from(chunk, _HEADER.size)
    begin = _HEADER.size + _TEXT.size
    compression = chunk[begin : begin + length].decode()
    return unpack_beginning(chunk[begin + length + _LENGTH.size :], compression)
