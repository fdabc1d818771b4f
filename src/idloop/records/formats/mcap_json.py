"""Messages of JSON in an MCAP file, as programs without ROS record them: a column for each number of a topic.

Bags of ROS are MCAP files as well, with messages in CDR, and are read as bags. Source: *MCAP Format Specification*;
its *Well-known message encodings*.
"""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_DEPTH, MOST_TABLE
from idloop.errors import InputError
from idloop.records.bags.storage.readable_messages import cut_chunk_records
from idloop.records.bags.storage.storage_files import MCAP_MAGIC
from idloop.records.bags.storage.unpacking import limit_bag_readers
from idloop.records.formats.form import Form, Options
from idloop.records.tables.table import Table
from idloop.spelling import listed

_JSON = "json"


class _Topic:
    """Stamps [ns] and numbers of the messages of a topic; NaN where a message lacks one."""

    def __init__(self) -> None:
        self.stamps: array[int] = array("q")
        self.values: dict[str, array[float]] = {}

    def add(self, stamp: int, numbers: dict[str, float]) -> None:
        for name in numbers.keys() - self.values.keys():
            self.values[name] = array("d", [math.nan] * len(self.stamps))
        self.stamps.append(stamp)
        for name, values in self.values.items():
            values.append(numbers.get(name, math.nan))


def read_mcap_json(path: Path, _: Options) -> Table:
    """Read the numbers of the messages, with the times at which they were logged."""
    topics: dict[str, _Topic] = {}
    other: dict[str, None] = {}
    notes: list[str] = []
    count = 0
    try:
        for topic, encoding, stamp, data in _messages(path):
            if encoding != _JSON:
                other[topic] = None
                continue
            numbers = dict(_numbers(json.loads(data), "", 0))
            topics.setdefault(topic, _Topic()).add(stamp, numbers)
            count += len(topics[topic].values) + 1
            _check_size(path, topics, count)
    except InputError:
        raise
    except Exception:  # noqa: BLE001 - a cut or damaged file ends the reader in any way
        if not topics and not other:
            raise InputError(f"{path}: not a readable MCAP file; check the copy of the file") from None
        notes.append("the file is cut off or damaged; the messages before that are read")
    if not topics:
        kind = "has no messages" if not other else "is a recording of ROS; give it the suffix .mcap"
        raise InputError(f"{path}: it {kind}")
    if other:
        notes.append(f"topics whose messages are no JSON are left out: {listed(other)}")
    table = Table(path, {}, notes=notes)
    for name, of_topic in topics.items():
        clock = f"{name}.time"
        columns = {f"{name}/{field}": np.array(values) for field, values in of_topic.values.items()}
        table.columns |= {clock: np.array(of_topic.stamps) * 1e-9, **columns} if columns else {}
        table.clocks |= dict.fromkeys(columns, clock)
        table.units |= {clock: "s"} if columns else {}
    return table


def _check_size(path: Path, topics: dict[str, _Topic], count: int) -> None:
    """Refuse more than `MOST_TABLE` bytes of numbers, or more than `MOST_COLUMNS` of them in the messages of a time."""
    if 8 * count > MOST_TABLE:
        raise InputError(f"{path}: its messages take more than {MOST_TABLE >> 30} GiB; record fewer topics")
    if sum(len(one.values) for one in topics.values()) > MOST_COLUMNS:
        raise InputError(f"{path}: more than {MOST_COLUMNS:,} numbers in a message; record fewer topics")


def _messages(path: Path) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield topic, encoding, time of logging [ns] and content of each message; an error ends those of a cut file."""
    from mcap import records
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    channels: dict[int, Any] = {}

    def messages(found: Iterator[Any]) -> Iterator[tuple[str, str, int, bytes]]:
        for record in found:
            if isinstance(record, records.Channel):
                channels[record.id] = record
            elif isinstance(record, records.Message):
                channel = channels[record.channel_id]
                yield channel.topic, channel.message_encoding, record.log_time, record.data

    with path.open("rb") as stream:
        try:
            yield from messages(StreamReader(stream).records)
        except Exception:
            # A short recording is one chunk, whose messages before the cut are there.
            yield from messages(cut_chunk_records(path))
            raise


def _numbers(content: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their paths: ``pose.x``, ``torque[1]``."""
    if depth > MOST_DEPTH:
        return
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _numbers(value, f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(content, list):
        for place, value in enumerate(content):
            yield from _numbers(value, f"{name}[{place}]", depth + 1)
    elif isinstance(content, int | float) and abs(content) < math.inf:
        yield name or "value", float(content)


FORM = Form(
    "mcap_json",
    (),
    "MCAP with messages of JSON, `.mcap`",
    "numbers by topic and path `/motor/state/pose.x`, elements of lists `a[0]`; with the times at which they were"
    " logged in `topic.time` [s]",
    lambda head: head.startswith(MCAP_MAGIC),
    read_mcap_json,
)
