"""Bags of any storage, opened for reading; one that cannot be opened is refused with one line."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Integers
from idloop.errors import InputError
from idloop.records.bags.message_types import build_typestore
from idloop.records.bags.storage.bag_paths import mcap_encodings
from idloop.records.bags.storage.readable_messages import mcap_messages
from idloop.records.bags.storage.storage_file import StorageFile
from idloop.records.bags.storage.storage_files import DISTROS, read_metadata, storage_files
from idloop.records.bags.storage.unpacking import Scratch, damaged, one_line
from idloop.records.bags.topics import Topic
from idloop.spelling import check_known, listed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from rosbags.typesys.store import Typestore

    from idloop.records.bags.stream import JointStream

_MOST_CHANNELS = 64  # whose encoding is asked
_MAGIC, _SHORTEST = b"\x89MCAP0\r\n", 45  # of an mcap file: its end, and fewest bytes


class Bag(ExitStack[None]):
    """A bag open for reading: a folder of storage files, with or without its metadata, or one file, packed or not.

    `path`: folder or file: mcap and sqlite3 of ROS 2, ``.bag`` of ROS 1, each of them also packed by Zstandard.
    `distro`: ROS distribution that message types come from where the bag does not define them itself.
    `definitions`: further message definitions, type name to text of the ``.msg`` file.
    Raises InputError: missing, empty, truncated or foreign file; unknown `distro`.
    """

    custom: dict[str, str]  # text stored with the metadata
    announced: dict[str, int]  # messages of each topic according to the metadata; empty where the bag has none
    unknown_types: set[str]  # types without a definition, known once `typestore` was read
    decoded: dict[str, JointStream]  # topics that were read from it, by name

    def __init__(
        self, path: Path | str, distro: str | None = None, definitions: Mapping[str, str] | None = None
    ) -> None:
        super().__init__()
        self.path = Path(path)
        self._definitions = dict(definitions or {})
        self._files: list[StorageFile] = []
        self._scratch = self.enter_context(Scratch())
        self._typestore: Typestore | None = None
        self.unknown_types = set()
        self.decoded = {}
        if distro is not None:
            check_known(distro, DISTROS, "unknown ROS distribution")
        try:
            metadata = read_metadata(self.path)
            self.custom, self.announced = metadata.custom, metadata.counts
            self._distro = distro or metadata.distro
            for file in metadata.files or storage_files(self.path):
                self._open(file)
            self._check_counts()
        except BaseException:
            self.close()
            raise

    def _open(self, file: Path) -> None:
        try:
            self._files.append(self.enter_context(closing(StorageFile(file, self._scratch))))
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - rosbags lets struct, YAML and SQLite errors of damaged files through
            if file.suffix == ".mcap" and not _ends_well(file):
                raise InputError(_truncation_message(self.path, file)) from None
            # rosbags wraps its own errors, and prints those as a tuple.
            inner = error.__context__ if type(error.__context__) is type(error) else error
            kind = type(inner).__name__
            reason = inner.args[0] if kind == "ReaderError" and inner.args else f"{kind}: {inner}"
            raise damaged(file, f"cannot be read as a bag ({one_line(reason)})", self.path) from None

    def _check_counts(self) -> None:
        """Refuse a bag without messages, or without those of a topic that its metadata announce."""
        counts = {name: topic.count for name, topic in self.topics.items()}
        if not any(counts.values()):
            files = [one.path for one in self._files if one.path.suffix == ".mcap"]
            kinds = {kind for file in files for kind in mcap_encodings(file, _MOST_CHANNELS)} - {"cdr", ""}
            if kinds == {"json"}:
                raise InputError(
                    f"{self.path}: its messages are JSON and not of ROS: `idloop start {files[0]}` makes a bag of them"
                )
            if kinds:
                raise InputError(
                    f"{self.path}: its messages are {listed(sorted(kinds))} and not of ROS: export the signals as CSV,"
                    " in Foxglove or PlotJuggler, and start that"
                )
            raise InputError(
                f"{self.path}: the bag is empty (no messages); check that the recorder had subscribed, then"
                " record again"
            )
        for topic, count in self.announced.items():
            if count and not counts.get(topic):
                raise damaged(self.path, f"{topic} should have {count} messages and has none")

    @property
    def topics(self) -> dict[str, Topic]:
        """Topics by name, as recorded."""
        found: dict[str, Topic] = {}
        for file in self._files:
            for connection in file.connections:
                before = found.get(connection.topic)
                count = connection.msgcount + (before.count if before else 0)
                found[connection.topic] = Topic(connection.topic, connection.msgtype, count)
        return dict(sorted(found.items()))

    def raw(self, topics: Collection[str]) -> dict[str, tuple[list[int], list[bytes]]]:
        """Return receive stamps in ns and serialised messages per topic, in the order of reception."""
        result: dict[str, tuple[list[int], list[bytes]]] = {topic: ([], []) for topic in topics}
        for topic, receive, data in self.messages(topics):
            stamps, payloads = result[topic]
            stamps.append(receive)
            payloads.append(data)
        return result

    def receive_stamps(self, topics: Collection[str]) -> dict[str, Integers]:
        """Return receive stamps in ns per topic without keeping the messages."""
        found: dict[str, list[int]] = {topic: [] for topic in topics}
        for _, connection, receive, _ in self._messages(topics):
            found[connection.topic].append(receive)
        return {topic: np.array(stamps, dtype=np.int64) for topic, stamps in found.items()}

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, receive stamp in ns and message in CDR, in the order of reception; those of ROS 1 converted."""
        for file, connection, receive, data in self._messages(topics):
            yield connection.topic, receive, self._as_cdr(connection, data) if file.ros1 else data

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[StorageFile, Any, int, bytes]]:
        try:
            for file in self._files:
                if wanted := [connection for connection in file.connections if connection.topic in topics]:
                    for connection, receive, data in file.messages(wanted):
                        yield file, connection, receive, data
        except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
            raise damaged(self.path, f"damaged inside ({one_line(error)})") from None

    def _as_cdr(self, connection: Any, data: bytes) -> bytes:
        """Convert a message of ROS 1."""
        try:
            return bytes(self.typestore.ros1_to_cdr(data, connection.msgtype))
        except Exception as error:  # noqa: BLE001 - the bytes may be anything
            what = f"a message on {connection.topic} is no {connection.msgtype} ({one_line(error)})"
            raise damaged(self.path, what) from None

    @property
    def typestore(self) -> Typestore:
        """Message types: those the bag defines, over those of the distribution."""
        if self._typestore is None:
            distro, topics = self._distro or "jazzy", list(self.topics.values())
            store = build_typestore(distro, self._definitions, self._files, topics, self._first_message)
            self.unknown_types = {topic.type for topic in topics if topic.type not in store.fielddefs}
            self._typestore = store
        return self._typestore

    def _first_message(self, topic: str) -> bytes | None:
        return next((data for _, _, _, data in self._messages([topic])), None)


def _ends_well(path: Path) -> bool:
    """Whether an mcap file is closed by its magic bytes."""
    with path.open("rb") as stream:
        if stream.seek(0, 2) < _SHORTEST:
            return False
        stream.seek(-len(_MAGIC), 2)
        return stream.read() == _MAGIC


def _truncation_message(bag: Path, file: Path) -> str:
    """Return how much of a cut mcap file can still be read, and how to save it."""
    stamps = [message.stamp_ns for message in mcap_messages(file) if message is not None]
    if not stamps:
        return f"{file}: the file is cut off and no message in it is readable; record again"
    return (
        f"{file}: the file is cut off (recorder killed or disk full?); {len(stamps)} messages over"
        f" {(max(stamps) - min(stamps)) * 1e-9:.1f} s are readable: save them with `idloop recover {bag}`"
    )
