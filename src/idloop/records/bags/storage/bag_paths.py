"""Which paths are bags of ROS, and which are other recordings in the same container."""

from __future__ import annotations

from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.records.bags.storage.readable_messages import cut_chunk_records
from idloop.records.bags.storage.storage_files import MCAP_MAGIC, storage_suffix
from idloop.records.bags.storage.unpacking import limit_bag_readers

if TYPE_CHECKING:
    from collections.abc import Iterator


def is_bag(path: Path | str) -> bool:
    """Whether a path looks like a bag: a folder, or a file whose name ends as a recording does.

    An MCAP file whose messages are JSON, as programs without ROS write it, is a table.
    """
    path = Path(path)
    return path.is_dir() or (storage_suffix(path) is not None and "json" not in mcap_encodings(path, 1))


def mcap_encodings(path: Path, most: int) -> list[str]:
    """Return the encodings of the messages of an MCAP file by its first channels; none of other files."""
    from mcap.records import Channel

    found: list[str] = []
    # A file that is damaged is refused where it is read.
    with suppress(Exception):
        with path.open("rb") as stream:
            if stream.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
                return []
        for record in chain(_whole_records(path), cut_chunk_records(path)):
            if isinstance(record, Channel):
                found.append(record.message_encoding)
            if len(found) == most:
                break
    return found


def _whole_records(path: Path) -> Iterator[Any]:
    """Records of an MCAP file up to where it is cut off."""
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    with suppress(Exception), path.open("rb") as stream:
        yield from StreamReader(stream).records
