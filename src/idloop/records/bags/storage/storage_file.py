"""One storage file of a bag, open for reading: mcap and sqlite3 of ROS 2, and the bags of ROS 1."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.bag_limits import limit_bag_readers, unpack_message
from idloop.records.bags.storage.storage_files import file_format
from idloop.records.bags.storage.streamed_mcap import StreamedMcap, other_profile
from idloop.records.bags.storage.unpacking import Scratch, unpack_file


class StorageFile:
    """A storage file; one that is packed as a whole, or whose messages are packed one by one, is unpacked.

    Parameters
    ----------
    path : Path
    scratch : Scratch
        For unpacked files.

    Attributes
    ----------
    connections : list
        Topics as rosbags has them: ``topic``, ``msgtype``, ``msgdef``, ``msgcount``.
    ros1 : bool
        Whether messages are in the serialisation of ROS 1.

    Raises
    ------
    InputError
        Empty, of no known format, or not to be unpacked.
    Exception
        Any, of the reader, for a damaged file.
    """

    def __init__(self, path: Path, scratch: Scratch) -> None:
        from rosbags.rosbag1 import Reader as Ros1Reader
        from rosbags.rosbag2.storage_mcap import McapReader
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

        limit_bag_readers()
        self.path = path
        kind = file_format(path)
        if kind == "zstd":
            path, _ = unpack_file(path, scratch)
            kind = file_format(path)
        if kind is None or kind == "zstd":
            raise InputError(f"{self.path}: holds no recording (.mcap, .db3 or .bag); name the recording")
        self.ros1 = kind == "ros1"
        reader: Any = {"mcap": McapReader, "sqlite3": Sqlite3Reader, "ros1": Ros1Reader}[kind]
        self._reader = (StreamedMcap if kind == "mcap" and other_profile(path) else reader)(path)
        self._reader.open()
        self.connections: list[Any] = list(self._reader.connections)

    def messages(self, connections: Iterable[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, receive time [ns] and content."""
        for connection, stamp, data in self._reader.messages(list(connections)):
            yield connection, stamp, bytes(data) if self.ros1 else unpack_message(data)

    def close(self) -> None:
        """Close the file."""
        self._reader.close()
