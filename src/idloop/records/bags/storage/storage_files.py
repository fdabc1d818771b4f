"""The files of a bag: which they are, in which order, in which format, and what its metadata say."""

from __future__ import annotations

import operator
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, Literal

from idloop.documents import read_text, read_yaml
from idloop.errors import InputError
from idloop.records.bags.storage.unpacking import ZSTD_MAGIC, damaged
from idloop.spelling import did_you_mean, listed

Format = Literal["mcap", "sqlite3", "ros1", "zstd"]

SUFFIXES = (".mcap", ".db3", ".bag")
PACKED = (".zstd", ".zst")
METADATA = "metadata.yaml"
DISTROS = ("humble", "iron", "jazzy", "kilted", "lyrical")
RECOVERED = "_recovered"  # behind the name of a bag that was cut off: what could be saved of it
MCAP_MAGIC = b"\x89MCAP0\r\n"
_MAGIC: dict[Format, bytes] = {
    "mcap": MCAP_MAGIC,
    "sqlite3": b"SQLite format 3\x00",
    "ros1": b"#ROSBAG V",
    "zstd": ZSTD_MAGIC,
}
_FORMAT_OF_SUFFIX: dict[str, Format] = {".mcap": "mcap", ".db3": "sqlite3", ".bag": "ros1"}


def bag_name(path: Path | str) -> str:
    """Return the name of a bag: that of its folder, or of its file without the suffixes of a recording.

    A dot in the name stays: ``run_0.5`` is no file of the type ``5``.
    """
    name = Path(path).resolve().name
    for suffix in (*PACKED, *SUFFIXES):
        name = name.removesuffix(suffix) or name
    return name


def storage_suffix(path: Path) -> str | None:
    """Return ``.mcap``, ``.db3`` or ``.bag`` of a file, also of a packed one; None for files of other types."""
    name = path.name
    for packed in PACKED:
        name = name.removesuffix(packed)
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), None)


def storage_files(path: Path) -> list[Path]:
    """Return the files of a bag in the order of recording, without regard to its metadata.

    Raises InputError: no such bag, a folder without a recording, or a file that is none.
    """
    if not path.exists():
        near = sorted(entry.name for entry in path.parent.iterdir()) if path.parent.is_dir() else []
        raise InputError(f"{path}: no such bag{did_you_mean(path.name, near) or '; check the path'}")
    if path.is_dir():
        files = sorted((one for one in path.iterdir() if one.is_file() and storage_suffix(one)), key=_number)
        if not files:
            raise InputError(
                f"{path}: a directory without a bag in it (no {METADATA}, .mcap, .db3 or .bag); name the bag's own"
                " directory"
            )
        return files
    if storage_suffix(path) is None and file_format(path) is None:
        raise InputError(
            f"{path}: not a bag (.mcap, .db3, .bag or a rosbag2 directory); tables come in through `idloop start`"
        )
    return [path]


def file_format(path: Path) -> Format | None:
    """Return the format by the first bytes of a file; by its name where it is cut off within them.

    Raises InputError: the file is empty, cannot be read, or its name promises another format.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    promised = _FORMAT_OF_SUFFIX.get(path.suffix)
    if not begin and storage_suffix(path):
        raise InputError(f"{path}: the file is empty (0 bytes); record again")
    for found, magic in _MAGIC.items():
        if begin.startswith(magic) or (promised == found and magic.startswith(begin)):
            return found
    if promised is not None:
        raise InputError(
            f"{path}: this is no {path.suffix[1:]} file (it does not begin with the magic bytes of one); name the"
            " recording, or give the file its proper suffix"
        )
    return None


def _number(file: Path) -> tuple[int, str]:
    """Order of the files of a bag: name_10 comes after name_9."""
    number = re.search(r"_(\d{1,18})$", bag_name(file), flags=re.ASCII)
    return (int(number[1]) if number else -1), file.name


@dataclass(frozen=True)
class BagMetadata:
    """What the metadata say; empty where a bag has none."""

    # Storage files in their order; empty where none of those named is there, as after renaming
    files: tuple[Path, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)  # messages by topic
    custom: dict[str, str] = field(default_factory=dict)  # text that was stored with the bag
    distro: str | None = None  # ROS distribution that recorded it, where it is known


def read_metadata(bag: Path) -> BagMetadata:
    """Read the metadata of a bag; storage and compression are seen from the files themselves.

    Raises InputError: damaged metadata, or a part of the files is missing.
    """
    path = bag / METADATA
    if not bag.is_dir() or not path.exists():
        return BagMetadata()
    try:
        content: Any = read_yaml(read_text(path), str(path))
        found = content["rosbag2_bagfile_information"]
        names = [PurePath(str(name)).name for name in found["relative_file_paths"]]
        counts: Counter[str] = Counter()
        for topic in found["topics_with_message_count"]:
            counts[str(topic["topic_metadata"]["name"])] += operator.index(topic["message_count"])
        custom = found.get("custom_data") or {}
        texts = {str(key): str(text) for key, text in custom.items()}
    except InputError as error:
        raise damaged(bag, f"cannot be read as a bag ({error})") from None
    except (KeyError, TypeError, ValueError, AttributeError):
        raise damaged(bag, "cannot be read as a bag (its metadata are damaged)") from None
    there = {name: one for name in names if (one := _there(bag, name)) is not None}
    missing = [name for name in names if name not in there]
    if missing and (there or not any(map(storage_suffix, bag.iterdir()))):
        raise InputError(
            f"{bag}: cannot be read as a bag ({listed(missing)} of its {METADATA} is missing); copy it as well, or name"
            " a file that is there"
        )
    distro = found.get("ros_distro")
    return BagMetadata(tuple(there.values()), counts, texts, distro if distro in DISTROS else None)


def _there(bag: Path, name: str) -> Path | None:
    """Return a file of the metadata, whether or not it was packed or unpacked since."""
    plain = next((name.removesuffix(packed) for packed in PACKED if name.endswith(packed)), name)
    found = (bag / one for one in (name, plain, *(plain + packed for packed in PACKED)))
    return next((one for one in found if one.is_file()), None)
