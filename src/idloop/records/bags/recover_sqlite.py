"""Messages of a rosbag2 SQLite file up to where it was cut off."""

from __future__ import annotations

from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from idloop.records.bags.recovered_channel import RecoveredChannel, RecoveredMessage
from idloop.records.bags.sqlite_pages import SqlitePages

_MESSAGE = (type(None), int, int, bytes)  # id (it is the row's), topic, time, content


def sqlite_messages(file: Path) -> Iterator[RecoveredMessage | None]:
    """Yield every whole message in the order of recording, then None where the file was cut.

    The tree of a cut file leads into nothing where a branch was moved behind the cut, so every page that is there is
    looked at.

    Parameters
    ----------
    file : Path
        ``.db3`` file, whole or not.
    """
    whole = False
    try:
        with file.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
            pages = SqlitePages(data)
            whole = pages.whole
            yield from _messages(pages)
    except ValueError:  # nothing in it, or no beginning of such a file
        whole = False
    if not whole:
        yield None


def _messages(pages: SqlitePages) -> Iterator[RecoveredMessage]:
    channels = _channels(pages)
    found: dict[int, int] = {}
    for number in pages.leaves():
        for row, values in pages.leaf(number):
            if tuple(map(type, values)) == _MESSAGE and values[1] in channels:
                found.setdefault(row, number)
    # Pages are read again in the order of recording, so that memory holds the content of one at a time.
    at, rows = 0, {}
    for row in sorted(found):
        if found[row] != at:
            at = found[row]
            rows = dict(pages.leaf(at))
        _, topic, stamp, content = rows[row]
        yield RecoveredMessage(channels[topic], stamp, content)


def _channels(pages: SqlitePages) -> dict[int, RecoveredChannel]:
    """Topics by their number, with the definitions of their messages where the recorder wrote them."""
    definitions = {
        row["topic_type"]: row["encoded_message_definition"]
        for _, row in _table(pages, "message_definitions")
        if row.get("encoding") == "ros2msg" and {"topic_type", "encoded_message_definition"} <= row.keys()
    }
    return {
        number: RecoveredChannel(
            topic=row["name"],
            message_type=row["type"],
            definition=definitions.get(row["type"], ""),
            type_hash=row.get("type_description_hash") or "",
            serialization=row["serialization_format"],
        )
        for number, row in _table(pages, "topics")
        if all(isinstance(row.get(key), str) for key in ("name", "type", "serialization_format"))
    }


def _table(pages: SqlitePages, name: str) -> Iterator[tuple[int, dict[str, Any]]]:
    found = pages.table(name)
    if found is not None:
        root, columns = found
        for number, values in pages.rows(root):
            yield number, dict(zip(columns, values, strict=False))
