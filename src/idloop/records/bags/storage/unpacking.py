"""Recordings packed as a whole, unpacked into the folder for temporary files and never beyond what fits there."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.bag_limits import limit_bag_readers

_STEP = 1 << 20
# Bytes of the disk that stay free for everything else.
_LEFT_FREE = 512 << 20


def unpack_file(packed: Path, folder: Path, *, keep_cut: bool = False) -> tuple[Path, bool]:
    """Unpack a file that Zstandard compressed.

    Parameters
    ----------
    packed : Path
        Stays as it is.
    folder : Path
        Where the unpacked file is written, without the last suffix.
    keep_cut : bool
        Keep what a cut or damaged file still gives.

    Returns
    -------
    Path, bool
        The unpacked file, and whether it is whole.

    Raises
    ------
    InputError
        Damaged, or it unpacks to more than its share or than the disk holds.
    """
    from rosbags.rosbag2 import reader  # brings the module of the standard library, or its backport

    limit_bag_readers()
    zstd: Any = vars(reader)["zstd"]
    target = folder / packed.stem
    written, whole = 0, True
    with packed.open("rb") as raw, target.open("wb") as out:
        try:
            with zstd.open(raw, "rb") as unpacked:
                while part := unpacked.read(_STEP):
                    written += len(part)
                    _check_room(packed, folder)
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
