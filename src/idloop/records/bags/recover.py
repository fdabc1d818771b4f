"""Save what can be read of a recording that was cut off by a crash."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError, InputError
from idloop.records.bags.recover_mcap import mcap_messages
from idloop.records.bags.recover_sqlite import sqlite_messages
from idloop.records.bags.recovered_channel import RecoveredChannel

_READERS = {".mcap": mcap_messages, ".db3": sqlite_messages}


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
        Files that ended before their end, or in which a time is damaged.
    """

    bag: Path
    messages: int
    duration: float
    topics: dict[str, int]
    cut: tuple[Path, ...]


def _number(file: Path) -> tuple[int, str]:
    """Files of a bag in the order of their numbers: the eleventh, name_10, comes after name_9."""
    number = file.stem.rpartition("_")[2]
    return (int(number) if number.isascii() and number.isdigit() else -1), file.name


def _files(bag: Path) -> list[Path]:
    if not bag.exists():
        raise InputError(f"{bag}: no such bag: check the path")
    files = [bag] if bag.is_file() else sorted((one for one in bag.iterdir() if one.suffix in _READERS), key=_number)
    if not files or files[0].suffix not in _READERS:
        raise InputError(f"{bag}: no recording: give a folder with .mcap or .db3 files, or such a file")
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
        raise InputError(f"{target}: exists already and is not overwritten: name another folder")

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
                if writer is None:  # only now: nothing to save leaves nothing behind
                    writer = stack.enter_context(Writer(target, version=9, storage_plugin=StoragePlugin.MCAP))
                channel = message.channel
                key = (channel.topic, channel.message_type)
                if key not in connections:
                    connections[key] = _connect(writer, store, channel)
                if 0 <= message.stamp_ns < 2**63:
                    first, last = min(first, message.stamp_ns), max(last, message.stamp_ns)
                    stamp = message.stamp_ns
                else:  # a damaged time is no reason to lose what was said then
                    cut[file] = None
                    stamp = last
                writer.write(connections[key], stamp, message.data)
                topics[channel.topic] = topics.get(channel.topic, 0) + 1
    if writer is None:
        raise IdloopError(f"{bag}: no message in it can be read")
    duration = max(last - first, 0) * 1e-9
    return Recovered(target, sum(topics.values()), duration, dict(sorted(topics.items())), tuple(cut))


def _connect(writer: Any, store: Any, channel: RecoveredChannel) -> Any:
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
