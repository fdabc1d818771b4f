"""The bag: messages in an order that does not depend on their arrival, in files of small chunks."""

from __future__ import annotations

import contextlib
import heapq
import os
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from idloop.errors import InputError
from idloop_nodes.streams.mcap_file import McapFile

CHUNK_SIZE = 16 * 1024  # what a kill can cost; larger chunks compress better and lose more
METADATA_VERSION = 9
QOS_RELIABLE = {
    "history": "keep_last",
    "depth": 5000,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": {"sec": 9223372036, "nsec": 854775807},
    "lifespan": {"sec": 9223372036, "nsec": 854775807},
    "liveliness": "automatic",
    "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
    "avoid_ros_namespace_conventions": False,
}

# At equal times a reader meets a message before what it causes; results come last, whenever they were ready.
CAUSAL = ("reference", "excitation", "joint_states", "joint_command", "estimator/prediction", "estimator/residual")

Entry = tuple[int, int, int, bytes]  # stamp, rank of the topic, arrival, payload


def rank_topics(topics: Sequence[str]) -> dict[str, int]:
    """Return each topic's place among messages of one stamp."""
    rest = sorted(topic for topic in topics if topic not in CAUSAL)
    return {topic: place for place, topic in enumerate([*CAUSAL, *rest])}


class CanonicalOrder:
    """Sorts messages by stamp, then topic; keeps one that was repeated, because its answer did not arrive, once."""

    def __init__(self) -> None:
        self._heap: list[Entry] = []
        self._arrival = 0
        self._newest: tuple[int, int, bytes] | None = None

    def __len__(self) -> int:
        return len(self._heap)

    def add(self, stamp: int, rank: int, payload: bytes) -> None:
        """Take in one message."""
        self._arrival += 1
        heapq.heappush(self._heap, (stamp, rank, self._arrival, payload))

    def take(self, until: int | None = None) -> list[tuple[int, int, bytes]]:
        """Return (stamp, rank, payload) of everything before `until`, in order; everything when None."""
        result = []
        heap = self._heap
        while heap and (until is None or heap[0][0] < until):
            stamp, rank, _, payload = heapq.heappop(heap)
            one = stamp, rank, payload
            if one != self._newest:
                result.append(one)
            self._newest = one
        return result


def choose_folder(bag: str, directory: str, prefix: str) -> Path:
    """Return the named folder, or one named by the time of day; InputError: a recording is never written over."""
    if bag:
        path = Path(bag)
        if path.exists():
            raise InputError(f"bag {path} exists and is not written over: choose another name or remove it")
        return path
    stem = f"{prefix}_{time.strftime('%Y%m%d_%H%M%S')}"
    path = Path(directory) / stem
    number = 1
    while path.exists():
        number += 1
        path = Path(directory) / f"{stem}_{number}"
    return path


@dataclass
class _File:
    """Entry of one file in metadata.yaml."""

    path: str
    start: int = 2**63 - 1
    end: int = 0
    count: int = 0

    def entry(self) -> dict[str, Any]:
        start = self.start if self.count else 0
        return {
            "path": self.path,
            "starting_time": {"nanoseconds_since_epoch": start},
            "duration": {"nanoseconds": max(self.end - start, 0)},
            "message_count": self.count,
        }


@dataclass
class _Topic:
    name: str
    type: str
    digest: str
    definition: str
    count: int = 0
    channel: int = 0
    qos: list[dict[str, Any]] = field(default_factory=lambda: [dict(QOS_RELIABLE)])


class BagWriter:
    """Writes messages of topics (name: type) to a new folder; a new file after so much data or time, 0 never."""

    def __init__(
        self, folder: Path, topics: dict[str, str], distribution: str, split_bytes: int = 0, split_ns: int = 0
    ) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.folder = folder
        self.count = 0
        self._split_bytes, self._split_ns = split_bytes, split_ns
        self._distribution = distribution
        known = {store.value: store for store in Stores}
        store = get_typestore(known.get(f"ros2_{distribution}", Stores.LATEST))
        self._topics = {
            name: _Topic(name, kind, store.hash_rihs01(kind), store.generate_msgdef(kind, ros_version=2)[0])
            for name, kind in topics.items()
        }
        self._files: list[_File] = []
        self._writer: Any = None
        self._stream: IO[bytes] | None = None
        self._whole: _Whole | None = None
        self._closed = False
        # A busy disk takes seconds to sync: a file that is finished does so beside the next one.
        self._syncing = ThreadPoolExecutor(1, "sync")
        self._synced: list[Future[None]] = []
        try:
            folder.mkdir(parents=True)
            self._open_file()
        except OSError as error:
            raise InputError(f"bag {folder} cannot be made: {error.strerror}; choose another place") from error

    def write(self, topic: str, log_time: int, data: bytes, sequence: int = 0) -> None:
        """Append one message."""
        file = self._files[-1]
        if self._is_full(file, log_time):
            self._check_synced()
            self._close_file()
            self._open_file()
            file = self._files[-1]
        one = self._topics[topic]
        self._writer.add_message(one.channel, log_time, data, sequence)
        file.start, file.end = min(file.start, log_time), max(file.end, log_time)
        file.count += 1
        one.count += 1
        self.count += 1

    def close(self) -> None:
        """Finish the last file and write the metadata; a bag without a message goes again, its name stays free."""
        if self._closed:
            return
        self._closed = True
        # After a split for which no new file could be made there is no file to finish, but the last one to list.
        self._close_file()
        self._syncing.shutdown()
        if not self.count:
            self._remove()
            return
        self._write_metadata()
        self._check_synced()

    def discard(self) -> None:
        """Close and remove what was written: it is of another run."""
        self._closed = True
        self._close_file()
        self._syncing.shutdown()
        self._remove()

    def _remove(self) -> None:
        for name in (*(file.path for file in self._files), "metadata.yaml"):
            (self.folder / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # foreign files stay
            self.folder.rmdir()

    def _is_full(self, file: _File, log_time: int) -> bool:
        if not file.count:
            return False
        if self._split_ns and log_time - file.start >= self._split_ns:
            return True
        return bool(self._split_bytes and self._whole is not None and self._whole.written >= self._split_bytes)

    def _open_file(self) -> None:
        name = f"{self.folder.name}_{len(self._files)}.mcap"
        # Unbuffered: what the writer has handed over lies with the system, whatever happens to this process.
        self._stream = (self.folder / name).open("xb", buffering=0)
        self._whole = _Whole(self._stream)
        self._writer = McapFile(self._whole, CHUNK_SIZE, "idloop")
        schemas: dict[str, int] = {}
        for one in self._topics.values():
            if one.type not in schemas:
                schemas[one.type] = self._writer.add_schema(one.type, "ros2msg", one.definition.encode())
            one.channel = self._writer.add_channel(
                one.name,
                "cdr",
                schemas[one.type],
                {"offered_qos_profiles": _dump(one.qos), "topic_type_hash": one.digest},
            )
        self._files.append(_File(name))
        self._write_metadata()

    def _close_file(self) -> None:
        if self._stream is None:
            return
        self._writer.finish()
        self._synced.append(self._syncing.submit(_sync, self._stream))
        self._stream = None

    def _check_synced(self) -> None:
        """Raise what went wrong with a file that was finished, an `OSError`."""
        done, self._synced = [f for f in self._synced if f.done()], [f for f in self._synced if not f.done()]
        for file in done:
            file.result()

    def _write_metadata(self) -> None:
        filled = [file for file in self._files if file.count]
        start = min((file.start for file in filled), default=0)
        end = max((file.end for file in filled), default=0)
        content = {
            "rosbag2_bagfile_information": {
                "version": METADATA_VERSION,
                "storage_identifier": "mcap",
                "duration": {"nanoseconds": end - start},
                "starting_time": {"nanoseconds_since_epoch": start},
                "message_count": self.count,
                "topics_with_message_count": [
                    {
                        "topic_metadata": {
                            "name": one.name,
                            "type": one.type,
                            "serialization_format": "cdr",
                            "offered_qos_profiles": one.qos,
                            "type_description_hash": one.digest,
                        },
                        "message_count": one.count,
                    }
                    for one in self._topics.values()
                ],
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [file.path for file in self._files],
                "files": [file.entry() for file in self._files],
                "custom_data": None,
                "ros_distro": self._distribution,
            }
        }
        place, text = self.folder / "metadata.yaml", _dump(content)
        temporary = place.with_suffix(".yaml.tmp")
        try:
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(place)
        except PermissionError:
            # No new file can be made here any more: the old file must still list what was recorded.
            place.write_text(text, encoding="utf-8")


def _sync(stream: IO[bytes]) -> None:
    """Have the disk take a whole file, and close it."""
    with stream:
        os.fsync(stream.fileno())


class _Whole:
    """Makes every write of an unbuffered file complete; the system may take only a part of one."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.written = 0  # counted here: asking the system for every message costs a tenth of recording it

    def write(self, data: bytes) -> int:
        self.written += len(data)
        view = memoryview(data)
        while view:
            view = view[self._stream.write(view) :]
        return len(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _dump(content: object) -> str:
    import yaml

    # ros2 bag reads plain YAML: no anchors for values that occur twice
    class Plain(yaml.SafeDumper):  # type: ignore[misc]
        def ignore_aliases(self, data: object) -> bool:
            return True

    return str(yaml.dump(content, Dumper=Plain, sort_keys=False, default_flow_style=False))
