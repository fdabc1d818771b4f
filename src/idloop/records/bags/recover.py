"""Recovery of the readable messages of a recording that was cut off by a crash."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError, InputError
from idloop.records.bags.bag_limits import limit_bag_readers
from idloop.records.bags.sqlite_pages import SqlitePages

_SQLITE_MESSAGE = (type(None), int, int, bytes)  # id (it is the row's), topic, time, content


@dataclass(frozen=True)
class Channel:
    """One topic of a recording.

    Attributes
    ----------
    topic, message_type : str
    definition, type_hash : str
        Text of the message's definition and REP-2011 hash of the type; empty where the recording has none.
    serialization : str
        Usually ``cdr``.
    """

    topic: str
    message_type: str
    definition: str
    type_hash: str
    serialization: str


@dataclass(frozen=True)
class Message:
    """One message: its topic, the time at which the recorder received it [ns], and its bytes."""

    channel: Channel
    stamp_ns: int
    data: bytes


def mcap_messages(file: Path) -> Iterator[Message | None]:
    """Yield the messages of every complete chunk of an mcap file in its order, then None where the file was cut."""
    from mcap import records
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    schemas: dict[int, records.Schema] = {}
    channels: dict[int, Channel] = {}
    whole = False
    with file.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                whole = whole or isinstance(record, records.Footer)
                if isinstance(record, records.Schema):
                    schemas[record.id] = record
                elif isinstance(record, records.Channel):
                    schema = schemas[record.schema_id]
                    channels[record.id] = Channel(
                        topic=record.topic,
                        message_type=schema.name,
                        definition=schema.data.decode(),
                        type_hash=record.metadata.get("topic_type_hash", ""),
                        serialization=record.message_encoding,
                    )
                elif isinstance(record, records.Message):
                    yield Message(channels[record.channel_id], record.log_time, record.data)
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            whole = False
    if not whole:
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


_READERS = {".mcap": mcap_messages, ".db3": sqlite_messages}


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery.

    Attributes
    ----------
    bag : Path
        The new bag.
    messages : int
        Messages saved.
    duration : float
        Time that they span on the recorder's clock [s].
    topics : dict of str to int
        Messages saved, by topic.
    cut : tuple of Path
        Files that are cut off, or in which a time is damaged.
    """

    bag: Path
    messages: int
    duration: float
    topics: dict[str, int]
    cut: tuple[Path, ...]


def _number(file: Path) -> tuple[int, str]:
    """Order of the files of a bag: name_10 comes after name_9."""
    number = file.stem.rpartition("_")[2]
    return (int(number) if number.isascii() and number.isdigit() else -1), file.name


def _files(bag: Path) -> list[Path]:
    if not bag.exists():
        raise InputError(f"{bag}: no such bag; check the path")
    files = [bag] if bag.is_file() else sorted((one for one in bag.iterdir() if one.suffix in _READERS), key=_number)
    if not files or files[0].suffix not in _READERS:
        raise InputError(f"{bag}: no recording; give a folder with .mcap or .db3 files, or such a file")
    return files


def recover_bag(bag: Path, target: Path) -> Recovered:
    """Copy every readable message of a recording into a new mcap bag; the old one stays as it is.

    Parameters
    ----------
    bag : Path
        Folder, ``.mcap`` or ``.db3`` file, whole or cut off.
    target : Path
        Folder to create.

    Raises
    ------
    InputError
        No such bag, no recording, or `target` exists.
    IdloopError
        No message can be read.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    files = _files(bag)
    if target.exists():
        raise InputError(f"{target}: exists already and is not overwritten; name another folder")

    store = get_typestore(Stores.LATEST)
    topics: dict[str, int] = {}
    cut: dict[Path, None] = {}
    connections: dict[tuple[str, str], Any] = {}
    first, last = 2**63 - 1, 0
    with ExitStack() as stack:
        writer = None
        for file in files:
            for message in _READERS[file.suffix](file):
                if message is None:
                    cut[file] = None
                    continue
                if writer is None:  # created with the first message, so that no empty bag is left behind
                    writer = stack.enter_context(Writer(target, version=9, storage_plugin=StoragePlugin.MCAP))
                channel = message.channel
                key = (channel.topic, channel.message_type)
                if key not in connections:
                    connections[key] = _connect(writer, store, channel)
                if 0 <= message.stamp_ns < 2**63:
                    first, last = min(first, message.stamp_ns), max(last, message.stamp_ns)
                    stamp = message.stamp_ns
                else:  # the time is damaged, the message is kept
                    cut[file] = None
                    stamp = last
                writer.write(connections[key], stamp, message.data)
                topics[channel.topic] = topics.get(channel.topic, 0) + 1
    if writer is None:
        raise IdloopError(f"{bag}: no message in it can be read; record again")
    duration = max(last - first, 0) * 1e-9
    return Recovered(target, sum(topics.values()), duration, dict(sorted(topics.items())), tuple(cut))


def _connect(writer: Any, store: Any, channel: Channel) -> Any:
    """Add a topic to the new bag; a type that neither the recording nor ROS describes is kept by its name."""
    known = channel.message_type in store.types
    definition, type_hash = channel.definition, channel.type_hash
    if known and not definition:
        definition, _ = store.generate_msgdef(channel.message_type, ros_version=2)
    if not type_hash:
        type_hash = store.hash_rihs01(channel.message_type) if known else "RIHS01_" + 64 * "0"
    return writer.add_connection(
        channel.topic,
        channel.message_type,
        msgdef=definition,
        rihs01=type_hash,
        serialization_format=channel.serialization,
    )
