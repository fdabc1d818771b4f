"""Save what can be read of a recording that was cut off by a crash."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError, InputError


@dataclass(frozen=True)
class Recovered:
    """What was saved.

    Attributes
    ----------
    bag : Path
        The new bag.
    messages : int
        Messages saved, by topic in `topics`.
    duration : float
        Time that they span on the recorder's clock [s].
    cut : tuple of Path
        Files that ended before their end.
    """

    bag: Path
    messages: int
    duration: float
    topics: dict[str, int]
    cut: tuple[Path, ...]


def _files(bag: Path) -> list[Path]:
    if not bag.exists():
        raise InputError(f"{bag}: no such bag: check the path")
    files = [bag] if bag.is_file() else sorted(bag.glob("*.mcap"))
    if not files:
        raise InputError(f"{bag}: holds no .mcap file: only mcap recordings can be recovered")
    return files


def _records(file: Path) -> Iterator[Any]:
    """Yield the records of one file up to its end or its cut; the last one is None at a cut."""
    from mcap.records import Footer
    from mcap.stream_reader import StreamReader

    whole = False
    with file.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                whole = whole or isinstance(record, Footer)
                yield record
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            whole = False
    if not whole:
        yield None


def recover_bag(bag: Path, target: Path) -> Recovered:
    """Copy every readable message of an mcap recording into a new bag; the old one stays as it is.

    Parameters
    ----------
    bag : Path
        Folder or ``.mcap`` file, whole or cut off.
    target : Path
        Folder to create.

    Raises
    ------
    InputError
        No such bag, not an mcap recording, or `target` exists.
    IdloopError
        No message can be read.
    """
    from mcap.records import Channel, Message, Schema
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    files = _files(bag)
    if target.exists():
        raise InputError(f"{target}: exists already and is not overwritten: name another folder")
    if all(not any(isinstance(record, Message) for record in _records(file)) for file in files):
        raise IdloopError(f"{bag}: no message in it can be read")

    store = get_typestore(Stores.LATEST)
    topics: dict[str, int] = {}
    cut: list[Path] = []
    connections: dict[tuple[str, str], Any] = {}
    first, last = 2**63 - 1, 0
    with Writer(target, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for file in files:
            schemas: dict[int, Any] = {}
            channels: dict[int, Any] = {}
            for record in _records(file):
                if record is None:
                    cut.append(file)
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas[record.schema_id]
                    key = (record.topic, schema.name)
                    if key not in connections:
                        known = store.hash_rihs01(schema.name) if schema.name in store.types else "RIHS01_" + 64 * "0"
                        connections[key] = writer.add_connection(
                            record.topic,
                            schema.name,
                            msgdef=schema.data.decode(),
                            rihs01=record.metadata.get("topic_type_hash", known),
                            serialization_format=record.message_encoding,
                        )
                    channels[record.id] = connections[key]
                elif isinstance(record, Message):
                    connection = channels[record.channel_id]
                    writer.write(connection, record.log_time, record.data)
                    topics[connection.topic] = topics.get(connection.topic, 0) + 1
                    first, last = min(first, record.log_time), max(last, record.log_time)
    return Recovered(target, sum(topics.values()), (last - first) * 1e-9, dict(sorted(topics.items())), tuple(cut))
