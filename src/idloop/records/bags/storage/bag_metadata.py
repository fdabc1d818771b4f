"""The metadata file of a rosbag2 folder: which files, how many messages, and text that was stored with them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from idloop.documents import read_text, read_yaml
from idloop.errors import InputError
from idloop.records.bags.storage.storage_files import METADATA, PACKED, storage_suffix
from idloop.spelling import listed

DISTROS = ("humble", "iron", "jazzy", "kilted", "lyrical")


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
    cure = f"copy it again, or save the messages with `idloop recover {bag}`"
    try:
        content: Any = read_yaml(read_text(path), str(path))
        found = content["rosbag2_bagfile_information"]
        names = [PurePath(str(name)).name for name in found["relative_file_paths"]]
        counts: dict[str, int] = {}
        for topic in found["topics_with_message_count"]:
            name = str(topic["topic_metadata"]["name"])
            counts[name] = counts.get(name, 0) + _whole(topic["message_count"])
        custom = found.get("custom_data") or {}
        texts = {str(key): str(text) for key, text in custom.items()}
    except InputError as error:
        raise InputError(f"{bag}: cannot be read as a bag ({error}); {cure}") from None
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{bag}: cannot be read as a bag (its metadata are damaged); {cure}") from None
    there = {name: one for name in names if (one := _there(bag, name)) is not None}
    missing = [name for name in names if name not in there]
    if missing and (there or not any(map(storage_suffix, bag.iterdir()))):
        raise InputError(
            f"{bag}: cannot be read as a bag ({listed(missing)} of its {METADATA} is missing); copy it as well, or name"
            " a file that is there"
        )
    distro = found.get("ros_distro")
    return BagMetadata(tuple(there.values()), counts, texts, distro if distro in DISTROS else None)


def _whole(count: object) -> int:
    if not isinstance(count, int):
        raise TypeError("not a number of messages")
    return count


def _there(bag: Path, name: str) -> Path | None:
    """Return a file of the metadata, whether or not it was packed or unpacked since."""
    plain = next((name.removesuffix(packed) for packed in PACKED if name.endswith(packed)), name)
    found = (bag / one for one in (name, plain, *(plain + packed for packed in PACKED)))
    return next((one for one in found if one.is_file()), None)
