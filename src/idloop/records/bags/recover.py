"""Recovery of the readable messages of a recording that was cut off by a crash."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.errors import IdloopError, InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.joint_states import plain_layout
from idloop.records.bags.storage.message import Channel, Message
from idloop.records.bags.storage.readable_messages import readable_messages
from idloop.records.bags.storage.storage_files import read_metadata, storage_files
from idloop.records.bags.storage.unpacking import Scratch, one_line
from idloop.records.bags.stream import JOINT_STATE

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery: what was written, and read back."""

    bag: Path  # the new bag
    messages: int  # messages saved
    duration: float  # time that they span on the recorder's clock [s]
    topics: dict[str, int]  # messages saved, by topic
    cut: tuple[Path, ...] = ()  # files that are cut off, or in which something is damaged
    # Messages whose content does not fit their type, by topic; they were not saved
    left_out: dict[str, int] = field(default_factory=dict)
    # Messages that the metadata announce and the files do not hold, by topic
    missing: dict[str, int] = field(default_factory=dict)
    unchecked: tuple[str, ...] = ()  # topics whose type neither the recording nor ROS describes: saved as they are

    @property
    def state(self) -> str:
        """What is known of the old recording and of the new one, in a few words."""
        found = {
            "file(s) cut off or damaged": len(self.cut),
            "damaged message(s) left out": sum(self.left_out.values()),
            "message(s) that the metadata announce are not there": sum(self.missing.values()),
        }
        parts = [f"{count} {what}" for what, count in found.items() if count] or ["the recording was whole"]
        unchecked = f", without their content on {len(self.unchecked)} topic(s) of unknown type"
        return f"{'; '.join(parts)}; every saved message was read back{unchecked if self.unchecked else ''}"


def recover_bag(bag: Path, target: Path) -> Recovered:
    """Copy every readable message of a recording into a new mcap bag and read it back; the old one stays as it is.

    `bag`: folder or file, whole or cut off, packed or not, of ROS 2 or ROS 1.
    `target`: folder to create; removed again where it cannot be read.
    Raises InputError: no such bag, no recording, or `target` exists.
    Raises IdloopError: no message can be read, or the new bag cannot be read.
    """
    files = storage_files(bag)
    if target.exists():
        raise InputError(f"{target}: exists already and is not overwritten; name another folder")
    copy = _Copy(target)
    try:
        with Scratch() as scratch:
            copy.write(_in_order(files, scratch))
        _read_back(bag, copy)
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        raise
    try:
        announced = read_metadata(bag).counts
    except InputError:  # damaged: it announces nothing
        announced = {}
    seen = copy.topics + copy.left_out
    return Recovered(
        bag=target,
        messages=copy.topics.total(),
        duration=max(copy.last - copy.first, 0) * 1e-9,
        topics=dict(sorted(copy.topics.items())),
        cut=tuple(copy.cut),
        left_out=dict(copy.left_out),
        missing={topic: count - seen[topic] for topic, count in announced.items() if count > seen[topic]},
        unchecked=tuple(sorted({topic for topic, kind in copy.connections if copy.stores[topic, kind] is None})),
    )


def _in_order(files: list[Path], scratch: Scratch) -> Iterator[tuple[Path, Message | None]]:
    for file in files:
        try:
            for message in readable_messages(file, scratch):
                yield file, message
        except InputError:  # empty, or not to be unpacked at all: the other files may be better
            yield file, None


class _Copy:
    """The new bag while it is written."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self.topics: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()
        self.cut: dict[Path, None] = {}
        self.connections: dict[tuple[str, str], Any] = {}
        self.stores: dict[tuple[str, str], Typestore | None] = {}  # None where the type is unknown
        self.first, self.last = 2**63 - 1, 0

    def write(self, messages: Iterator[tuple[Path, Message | None]]) -> None:
        """Write all of them; the bag is created with the first, so that no empty one is left behind."""
        from rosbags.rosbag2 import StoragePlugin, Writer

        with ExitStack() as stack:
            writer = None
            for file, message in messages:
                if message is None or not self._decodes(message):
                    self.cut[file] = None
                    continue
                channel, stamp = message.channel, message.stamp_ns
                key = (channel.topic, channel.message_type)
                if writer is None:
                    writer = stack.enter_context(Writer(self.target, version=9, storage_plugin=StoragePlugin.MCAP))
                if key not in self.connections:
                    self.connections[key] = _connect(writer, channel, self.stores[key])
                if 0 <= stamp < 2**63:
                    self.first, self.last = min(self.first, stamp), max(self.last, stamp)
                else:  # the time is damaged, the message is kept
                    self.cut[file], stamp = None, self.last
                writer.write(self.connections[key], stamp, message.data)
                self.topics[channel.topic] += 1

    def _decodes(self, message: Message) -> bool:
        """Whether the content fits the type; True where the type is unknown."""
        channel = message.channel
        key = (channel.topic, channel.message_type)
        if key not in self.stores:
            self.stores[key] = _typestore(channel.message_type, channel.definition)
        try:
            _decode(self.stores[key], channel.message_type, message.data)
        except Exception:  # noqa: BLE001 - the bytes may be anything
            self.left_out[channel.topic] += 1
            return False
        return True


@lru_cache(maxsize=64)
def _typestore(message_type: str, definition: str) -> Typestore | None:
    """Types that the recording defines, over those of ROS; None where neither describes this one."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = get_typestore(Stores.LATEST)
    with suppress(Exception):  # the text may be anything
        if definition:
            store = get_typestore(Stores.EMPTY)
            store.register({**known.fielddefs, **get_types_from_msg(definition, message_type)})
            if message_type != JOINT_STATE:  # which is taken apart without it
                store.get_msgdef(message_type)
            return store
    return known if message_type in known.fielddefs else None


def _decode(store: Typestore | None, message_type: str, data: bytes) -> None:
    """Take a message apart as the readers do; an error of any kind where it does not fit its type."""
    if message_type == JOINT_STATE:
        plain_layout(data)
    elif store is not None:
        store.deserialize_cdr(data, message_type)


def _connect(writer: Any, channel: Channel, store: Typestore | None) -> Any:
    """Add a topic to the new bag; a type that neither the recording nor ROS describes whole is kept by its name."""
    definition, type_hash = channel.definition, channel.type_hash
    with suppress(KeyError):
        if store is not None and not definition:
            definition, _ = store.generate_msgdef(channel.message_type, ros_version=2)
        if store is not None and not type_hash:
            type_hash = store.hash_rihs01(channel.message_type)
    return writer.add_connection(
        channel.topic,
        channel.message_type,
        msgdef=definition,
        rihs01=type_hash or "RIHS01_" + 64 * "0",
        serialization_format=channel.serialization,
    )


def _read_back(bag: Path, copy: _Copy) -> None:
    """Open the new bag as any reader does, decode every message, and compare the counts.

    Raises IdloopError: there is none, it cannot be read, or it holds something else than was written.
    """
    if not copy.topics:
        raise IdloopError(f"{bag}: no message in it can be read; record again")
    found: Counter[str] = Counter()
    nothing_left = f"nothing is left in {copy.target}"
    try:
        with Bag(copy.target) as written:
            types = {name: topic.type for name, topic in written.topics.items()}
            for topic, _, data in written.messages(types):
                _decode(copy.stores[topic, types[topic]], types[topic], data)
                found[topic] += 1
    except Exception as error:  # noqa: BLE001 - rosbags lets many kinds of errors through
        raise IdloopError(
            f"{bag}: what could be read of it makes no bag that can be read ({one_line(error)}); {nothing_left}"
        ) from None
    if found != copy.topics:
        text = ", ".join(f"{topic}: {found[topic]} of {count}" for topic, count in copy.topics.items())
        raise IdloopError(f"{bag}: the new bag holds less than was written ({text}); {nothing_left}")
