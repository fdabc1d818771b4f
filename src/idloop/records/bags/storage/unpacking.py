"""Unpacking of chunks, messages and files within limits, which rosbags and mcap have none of."""

from __future__ import annotations

import bz2
import os
import shutil
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, BinaryIO

from idloop.errors import InputError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
# Bytes of an unpacked chunk or message; ros2 bag writes chunks of 0.8 MB, and messages of images are smaller.
MOST_UNPACKED = 256 << 20
# Further growth of a file that is unpacked as a whole, as a factor; messages of joints shrink to a tenth.
_MOST_GROWTH = 200
_STEP = 1 << 20
_LEFT_FREE = 512 << 20  # bytes of the disk that stay free for everything else


def one_line(reason: object) -> str:
    """Return the message of another library in a form that fits into a sentence."""
    return " ".join(str(reason).split()).rstrip(".")


def damaged(file: Path, what: str, bag: Path | None = None) -> InputError:
    """Return the error of a recording in which something is damaged; `bag` is the whole, where it is more."""
    return InputError(f"{file}: {what}; copy it again, or save the rest with `idloop recover {bag or file}`")


@cache
def limit_bag_readers() -> None:
    """Make rosbags and mcap unpack and parse within limits, in this process and for good."""
    from mcap import stream_reader
    from rosbags.rosbag1 import reader as ros1_reader
    from rosbags.rosbag2 import metadata, reader, storage_mcap

    from idloop.documents import LimitedYAML

    zstd: Any = vars(reader)["zstd"]
    unpack_zstd, unpack_lz4 = (_limited(_decompressors()[kind]) for kind in ("zstd", "lz4"))

    def open_zstd(file: BinaryIO, mode: str) -> Any:
        most = MOST_UNPACKED + _MOST_GROWTH * os.fstat(file.fileno()).st_size
        return _Counted(zstd.open(file, mode), most)

    for module in (metadata, reader):
        _replace(module, "YAML", LimitedYAML)
    _replace(reader, "zstd", SimpleNamespace(decompress=unpack_zstd, open=open_zstd))
    storage_mcap.DECOMPRESSORS.update(lz4=unpack_lz4, zstd=unpack_zstd)
    ros1_reader.decompressors.update(lz4=unpack_lz4, bz2=_limited(bz2.BZ2Decompressor))
    _replace(stream_reader, "zstandard", SimpleNamespace(decompress=unpack_zstd))
    _replace(stream_reader, "lz4", SimpleNamespace(decompress=unpack_lz4))


@cache
def _decompressors() -> dict[str, Callable[[], Any]]:
    """Makers of decompressors of one frame, by the name of the compression in an mcap file."""
    from mcap import stream_reader
    from rosbags.rosbag2 import reader  # brings the module of the standard library, or its backport

    # Called before the modules are replaced.
    zstd, lz4 = vars(reader)["zstd"], vars(stream_reader)["lz4"]
    return {"zstd": zstd.ZstdDecompressor, "lz4": lz4.LZ4FrameDecompressor}


def _replace(module: Any, name: str, value: Any) -> None:
    if not hasattr(module, name):
        raise AttributeError(f"{module.__name__} has no {name} any more: its limits have to be put elsewhere")
    setattr(module, name, value)


def _limited(decompressor: Callable[[], Any]) -> Callable[..., bytes]:
    def unpack(data: bytes, _size: int = 0) -> bytes:
        found, left = [], MOST_UNPACKED
        while data:
            frame = decompressor()
            part = frame.decompress(data, left + 1)
            left -= len(part)
            if left < 0:
                raise ValueError(f"a chunk or message unpacks to more than {MOST_UNPACKED >> 20} MiB")
            if not frame.eof:
                raise ValueError("compressed data are cut off")
            found.append(part)
            data = frame.unused_data
        return b"".join(found)

    return unpack


class _Counted:
    """A file that is unpacked while it is read, up to a limit."""

    def __init__(self, file: Any, most: int) -> None:
        self._file, self._left = file, most

    def __enter__(self) -> _Counted:  # noqa: PYI034 - Self needs Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, size: int = -1) -> bytes:
        data: bytes = self._file.read(size)
        self._left -= len(data)
        if self._left < 0:
            raise ValueError(f"the file unpacks to more than {_MOST_GROWTH} times its size")
        return data


def unpack_beginning(data: bytes, compression: str) -> bytes:
    """Return what the first bytes of a chunk hold, as far as they can be unpacked and within the limit.

    Raises Exception: any, where they are damaged or the compression is unknown.
    """
    limit_bag_readers()
    return bytes(_decompressors()[compression]().decompress(data, MOST_UNPACKED)) if compression else data


def unpack_message(data: bytes) -> bytes:
    """Return a message as it was published: one that the recorder packed says so in its first bytes, as no other does.

    Raises Exception: any, where it cannot be unpacked within the limit.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    from rosbags.rosbag2 import reader

    limit_bag_readers()
    return bytes(vars(reader)["zstd"].decompress(data))


class Scratch(ExitStack[None]):
    """A folder among the temporary files, made when the first file is unpacked and removed at the end."""

    @cached_property
    def folder(self) -> Path:
        """The folder."""
        return Path(self.enter_context(TemporaryDirectory(prefix="idloop-")))


def unpack_file(packed: Path, scratch: Scratch, *, keep_cut: bool = False) -> tuple[Path, bool]:
    """Unpack a file that Zstandard compressed.

    `packed`: stays as it is.
    `scratch`: where the unpacked file is written, without the last suffix.
    `keep_cut`: keep what a cut or damaged file still gives.
    Returns: the unpacked file, and whether it is whole.
    Raises InputError: damaged, or it unpacks to more than its share or than the disk holds.
    """
    from rosbags.rosbag2 import reader

    limit_bag_readers()
    target, whole = scratch.folder / packed.stem, True
    with packed.open("rb") as raw, target.open("wb") as out:
        try:
            with vars(reader)["zstd"].open(raw, "rb") as unpacked:
                while part := unpacked.read(_STEP):
                    _check_room(packed, scratch.folder)
                    out.write(part)
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - the bytes may be anything
            if not keep_cut or not out.tell():
                raise damaged(packed, f"cannot be unpacked ({one_line(error)})") from None
            whole = False
    return target, whole


def _check_room(packed: Path, folder: Path) -> None:
    if shutil.disk_usage(folder).free < _LEFT_FREE:
        raise InputError(
            f"{packed}: there is no room in {folder.parent} to unpack it; set TMPDIR to a folder on a larger disk"
        )
