"""Recordings packed as a whole, unpacked into the folder for temporary files and never beyond what fits there."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.bag_limits import limit_bag_readers

_STEP = 1 << 20
# Bytes of the disk that stay free for everything else.
_LEFT_FREE = 512 << 20


class Scratch:
    """A folder among the temporary files, made when the first file is unpacked and removed at the end."""

    def __init__(self) -> None:
        self._made: TemporaryDirectory[str] | None = None

    def __enter__(self) -> Scratch:  # noqa: PYI034 - Self needs Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()

    @property
    def folder(self) -> Path:
        """The folder."""
        if self._made is None:
            self._made = TemporaryDirectory(prefix="idloop-")
        return Path(self._made.name)

    def remove(self) -> None:
        """Remove it with all that it holds."""
        if self._made is not None:
            self._made.cleanup()
            self._made = None


def unpack_file(packed: Path, scratch: Scratch, *, keep_cut: bool = False) -> tuple[Path, bool]:
    """Unpack a file that Zstandard compressed.

    `packed`: stays as it is.
    `scratch`: where the unpacked file is written, without the last suffix.
    `keep_cut`: keep what a cut or damaged file still gives.
    Returns: the unpacked file, and whether it is whole.
    Raises InputError: damaged, or it unpacks to more than its share or than the disk holds.
    """
    from rosbags.rosbag2 import reader  # brings the module of the standard library, or its backport

    limit_bag_readers()
    zstd: Any = vars(reader)["zstd"]
    target = scratch.folder / packed.stem
    written, whole = 0, True
    with packed.open("rb") as raw, target.open("wb") as out:
        try:
            with zstd.open(raw, "rb") as unpacked:
                while part := unpacked.read(_STEP):
                    written += len(part)
                    _check_room(packed, scratch.folder)
                    out.write(part)
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - the bytes may be anything
            if not keep_cut or not written:
                reason = " ".join(str(error).split()).rstrip(".")
                raise InputError(
                    f"{packed}: cannot be unpacked ({reason}); copy it again, or save what is left with"
                    f" `idloop recover {packed}`"
                ) from None
            whole = False
    return target, whole


def _check_room(packed: Path, folder: Path) -> None:
    if shutil.disk_usage(folder).free < _LEFT_FREE:
        raise InputError(
            f"{packed}: there is no room in {folder.parent} to unpack it; set TMPDIR to a folder on a larger disk"
        )
