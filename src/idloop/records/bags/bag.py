"""Bags of any storage, opened for reading; one that cannot be opened is refused with one line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.bags.bag_limits import limit_bag_readers
from idloop.records.bags.topics import Topic
from idloop.spelling import did_you_mean, listed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from types import TracebackType

    from rosbags.typesys.store import Typestore

DISTROS = ("humble", "iron", "jazzy", "kilted", "lyrical")
_STORAGE = (".mcap", ".db3")
_MAGIC = b"\x89MCAP0\r\n"


class Bag:
    """A bag open for reading: a rosbag2 directory, a directory without its metadata, or one mcap or db3 file.

    Parameters
    ----------
    path : Path or str
        Directory or file.
    distro : str, optional
        ROS distribution that message types come from where the bag does not define them itself.
    definitions : mapping of str to str, optional
        Further message definitions, type name to text of the ``.msg`` file.

    Raises
    ------
    InputError
        Missing, empty, truncated or foreign file; unknown `distro`.
    """

    def __init__(
        self, path: Path | str, distro: str | None = None, definitions: Mapping[str, str] | None = None
    ) -> None:
        self.path = Path(path)
        self._distro = distro
        self._definitions = dict(definitions or {})
        self._readers: list[Any] = []
        self._typestore: Typestore | None = None
        self.unknown_types: set[str] = set()
        self.custom: dict[str, str] = {}
        if distro is not None and distro not in DISTROS:
            raise InputError(
                f"unknown ROS distribution {distro!r}; known are {listed(DISTROS)}{did_you_mean(distro, DISTROS)}"
            )
        for file in _files(self.path):
            self._open(file)
        if sum(topic.count for topic in self.topics.values()) == 0:
            self.close()
            raise InputError(
                f"{self.path}: the bag is empty (no messages); check that the recorder had subscribed, then"
                " record again"
            )

    def _open(self, file: Path) -> None:
        from rosbags.rosbag2 import Reader, ReaderError

        limit_bag_readers()
        reader = Reader(file)
        try:
            reader.open()
        except Exception as error:  # noqa: BLE001 - rosbags lets struct, YAML and SQLite errors of damaged files through
            self.close()
            cut = next(
                (part for part in _storage_files(self.path) if part.suffix == ".mcap" and not _ends_well(part)), None
            )
            if cut is not None and not _begins_well(cut):
                raise InputError(
                    f"{cut}: this is no mcap file (it does not begin with the magic bytes of one); name the recording,"
                    " or give the file its proper suffix"
                ) from None
            if cut is not None:
                raise InputError(_truncation_message(self.path, cut)) from None
            reason = (
                error.args[0] if isinstance(error, ReaderError) and error.args else f"{type(error).__name__}: {error}"
            )
            raise InputError(
                f"{file}: cannot be read as a bag ({one_line(reason)}); check the copy of the file"
            ) from None
        self._readers.append(reader)
        custom = getattr(reader.storage.metadata, "custom", None) or {}
        whole = isinstance(custom, dict) and all(isinstance(one.msgcount, int) for one in reader.connections)
        if not whole:
            self.close()
            raise InputError(
                f"{file}: cannot be read as a bag (its metadata are damaged); copy it again, or save the messages with"
                f" `idloop recover {file}`"
            )
        self.custom.update({str(key): str(value) for key, value in custom.items()})

    def __enter__(self) -> Bag:  # noqa: PYI034 - Self needs Python 3.11
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all files."""
        for reader in self._readers:
            reader.close()
        self._readers.clear()

    @property
    def topics(self) -> dict[str, Topic]:
        """Topics by name, as recorded."""
        found: dict[str, Topic] = {}
        for reader in self._readers:
            for connection in reader.connections:
                before = found.get(connection.topic)
                count = connection.msgcount + (before.count if before else 0)
                found[connection.topic] = Topic(connection.topic, connection.msgtype, count)
        return dict(sorted(found.items()))

    def raw(self, topics: Collection[str]) -> dict[str, tuple[list[int], list[bytes]]]:
        """Return receive stamps in ns and serialised messages per topic, in the order of reception."""
        result: dict[str, tuple[list[int], list[bytes]]] = {topic: ([], []) for topic in topics}
        for connection, receive, data in self._messages(topics):
            stamps, payloads = result[connection.topic]
            stamps.append(receive)
            payloads.append(data)
        return result

    def receive_stamps(self, topics: Collection[str]) -> dict[str, NDArray[np.int64]]:
        """Return receive stamps in ns per topic without keeping the messages."""
        found: dict[str, list[int]] = {topic: [] for topic in topics}
        for connection, receive, _ in self._messages(topics):
            found[connection.topic].append(receive)
        return {topic: np.array(stamps, dtype=np.int64) for topic, stamps in found.items()}

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[Any, int, bytes]]:
        try:
            for reader in self._readers:
                if wanted := [connection for connection in reader.connections if connection.topic in topics]:
                    yield from reader.messages(wanted)
        except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
            raise InputError(
                f"{self.path}: damaged inside ({one_line(error)}); copy it again, or save the rest with"
                f" `idloop recover {self.path}`"
            ) from None

    @property
    def typestore(self) -> Typestore:
        """Message types: those the bag defines, over those of the distribution."""
        if self._typestore is None:
            self._typestore = self._build_typestore()
        return self._typestore

    def _build_typestore(self) -> Typestore:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        stated = next((str(reader.ros_distro) for reader in self._readers if reader.ros_distro in DISTROS), None)
        base = get_typestore(Stores(f"ros2_{self._distro or stated or 'jazzy'}"))
        types: dict[str, Any] = dict(base.fielddefs)
        for name, text in self._definitions.items():
            try:
                types.update(get_types_from_msg(text, name))
            except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
                raise InputError(f"definition of {name}: not a valid .msg text ({one_line(error)})") from None
        for reader in self._readers:
            for connection in reader.connections:
                types.update(_own_types(connection))
        # A type that refers to an unknown one would make the whole store fail: leave such types out.
        while incomplete := [name for name, (_, fields) in types.items() if not _references(fields) <= types.keys()]:
            for name in incomplete:
                del types[name]
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        self.unknown_types = {topic.type for topic in self.topics.values() if topic.type not in types}
        return store


def _own_types(connection: Any) -> dict[str, Any]:
    """Return the types that the bag itself defines for a connection; none when the text cannot be parsed."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    definition = connection.msgdef
    try:
        if definition.format == MessageDefinitionFormat.MSG:
            return dict(get_types_from_msg(definition.data, connection.msgtype))
        if definition.format == MessageDefinitionFormat.IDL:
            found: dict[str, Any] = {}
            for part in definition.data.split("=" * 80 + "\n"):
                text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
                found |= get_types_from_idl(text) if text.strip() else {}
            return found
    except Exception:  # noqa: BLE001 - one unreadable definition must not stop the reading of the other topics
        return {}
    return {}


def _references(fields: Iterable[tuple[str, Any]]) -> set[str]:
    from rosbags.interfaces import Nodetype

    def names(node: Any) -> set[str]:
        kind, args = node
        if kind == Nodetype.NAME:
            return {args}
        return names(args[0]) if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else set()

    return {name for _, node in fields for name in names(node)}


def _files(path: Path) -> list[Path]:
    """Return what rosbags is to open: the directory with its metadata, or the storage files themselves."""
    if not path.exists():
        near = sorted(entry.name for entry in path.parent.iterdir()) if path.parent.is_dir() else []
        raise InputError(f"{path}: no such bag{did_you_mean(path.name, near) or '; check the path'}")
    if path.is_dir():
        if (path / "metadata.yaml").exists():
            return [path]
        if storage := _storage_files(path):
            return storage
        raise InputError(
            f"{path}: a directory without a bag in it (no metadata.yaml, .mcap or .db3); name the bag's own directory"
        )
    if path.suffix == ".bag":
        raise InputError(
            f"{path}: a ROS 1 bag; convert it first: rosbags-convert --src {path} --dst {path.with_suffix('')}"
        )
    if path.suffix not in _STORAGE:
        raise InputError(
            f"{path}: not a bag (.mcap, .db3 or a rosbag2 directory); tables come in through `idloop import`"
        )
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty (0 bytes); record again")
    return [path]


def _storage_files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix in _STORAGE)


def _begins_well(path: Path) -> bool:
    """Whether a file, as far as it goes, begins with the magic bytes of mcap."""
    with path.open("rb") as stream:
        return _MAGIC.startswith(stream.read(len(_MAGIC)))


def _ends_well(path: Path) -> bool:
    with path.open("rb") as stream:
        stream.seek(0, 2)
        if stream.tell() < 45:
            return False
        stream.seek(-8, 2)
        return stream.read() == _MAGIC


def _truncation_message(bag: Path, file: Path) -> str:
    """Return how much of a cut mcap file can still be read, and how to save it."""
    from idloop.records.bags.recover import mcap_messages

    stamps = [message.stamp_ns for message in mcap_messages(file) if message is not None]
    if not stamps:
        return f"{file}: the file is cut off and no message in it is readable; record again"
    return (
        f"{file}: the file is cut off (recorder killed or disk full?); {len(stamps)} messages over"
        f" {(max(stamps) - min(stamps)) * 1e-9:.1f} s are readable: save them with `idloop recover {bag}`"
    )


def one_line(reason: object) -> str:
    """Return the message of another library in a form that fits into a sentence."""
    return " ".join(str(reason).split()).rstrip(".")
