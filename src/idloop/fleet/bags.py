"""Which bags a fleet has: from a table, a folder or a pattern, on this machine or at an address."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date, datetime, timezone
from pathlib import Path, PurePosixPath
from typing import Any

from idloop.errors import InputError
from idloop.fleet.libraries import library
from idloop.records.bags.storage.storage_files import METADATA, RECOVERED, SUFFIXES, bag_name
from idloop.spelling import did_you_mean, listed

COLUMNS = ("robot", "joint", "time", "bag")
_TABLES = (".csv", ".parquet")
_DATE = re.compile(r"(?<!\d)(\d{4})[-_]?(\d{2})[-_]?(\d{2})(?:[-_T ]?(\d{2})[-_:]?(\d{2})(?:[-_:]?(\d{2}))?)?(?!\d)")
_PATTERN = re.compile(r"[*?\[]")
_CHANGED = ("mtime", "ETag", "etag", "LastModified", "updated", "created")  # what file systems have of a file's state


@dataclass(frozen=True)
class FleetBag:
    """One recording of one robot."""

    robot: str
    bag: str  # path or address
    time: datetime | None = None  # in UTC; None: that of its first measurement
    # Name and kind of each joint; an empty kind is found by the joint's name. Empty: all joints of the bag.
    joints: tuple[tuple[str, str], ...] = ()
    # Size and state of its files, by which an unchanged bag is known without being read; empty where there is none
    stamp: str = ""


def check_place(source: str) -> None:
    """Refuse a path on this machine at which nothing is, before any library is imported.

    Raises InputError: no such place.
    """
    if "://" not in source and not Path(_root(source)).exists():
        raise InputError(f"{source}: there is no such table or folder, check the path")


def find_bags(source: str, *, empty: bool = False) -> list[FleetBag]:
    """Return the bags of a table, of a folder or of a pattern, by robot and time.

    A table has the columns robot, joint, time and bag, and kind where joints have one; paths in it begin at its folder.
    Below a folder the first name is the robot, and a date in the path is the time. The folder of a pattern is what
    comes before the first ``*``, ``?`` or ``[``. With `empty` there may be none yet. What was recovered of a bag takes
    the place of that bag.

    Raises InputError: no such place, a table without a column or with a time that is none, no bag.
    """
    check_place(source)
    fs, path = open_place(source)
    found = _of_table(fs, path, source) if path.lower().endswith(_TABLES) else _of_folder(fs, path, source)
    if not found and not empty:
        raise InputError(f"{source}: there is no bag; a folder holds ROBOT/DATE/BAG, a table {listed(COLUMNS)}")
    names = {one.bag for one in found}
    kept = (one for one in found if _recovered(one.bag) not in names)
    return sorted(kept, key=lambda one: (one.robot, one.time is not None, one.time, one.bag))


def _recovered(bag: str) -> str:
    """Where `idloop recover` puts what it can read of a bag."""
    return f"{bag.rpartition('/')[0]}/{bag_name(bag)}{RECOVERED}"


def _root(path: str) -> str:
    """Folder or file of a place: of a pattern what comes before it."""
    pattern = _PATTERN.search(path)
    return path if pattern is None else path[: pattern.start()].rpartition("/")[0]


def open_place(source: str) -> tuple[Any, str]:
    """File system of a path or an address, and the path in it.

    Raises InputError: a file system that is not known, or whose library is not installed.
    """
    fsspec = library("fsspec")
    try:
        fs, path = fsspec.core.url_to_fs(source)
    except ImportError as error:
        from fsspec.registry import known_implementations

        package = known_implementations.get(source.partition("://")[0], {"class": ""})["class"].partition(".")[0]
        cure = f": pip install {package}" if package not in ("", "fsspec") else ""
        raise InputError(f"{source}: {' '.join(str(error).split())}{cure}") from error
    except ValueError as error:
        raise InputError(f"{source}: {' '.join(str(error).split())}") from error
    fs.invalidate_cache()  # what was listed before may have changed
    return fs, str(path)


def _of_folder(fs: Any, path: str, source: str) -> list[FleetBag]:
    root = _root(path)
    try:
        tops = [path] if root == path else sorted(fs.glob(path))
        files: dict[str, Mapping[str, Any]] = {}
        for top in tops:
            files |= fs.find(top, detail=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be listed ({error})") from error
    if not files and root == path and not fs.exists(path):
        raise InputError(f"{source}: there is no such table or folder, check the path")
    bags: dict[str, list[Mapping[str, Any]]] = {
        name.rpartition("/")[0]: [] for name in files if name.endswith(f"/{METADATA}")
    }
    for name, state in files.items():
        folder = name.rpartition("/")[0]
        if folder in bags:
            bags[folder].append(state)
        elif name.endswith(SUFFIXES):
            bags[name] = [state]
    found = []
    for name, states in bags.items():
        below = PurePosixPath(name).relative_to(root or "/").parts if name.startswith(root) else (name,)
        robot = below[0] if len(below) > 1 else PurePosixPath(root).name
        found.append(FleetBag(robot, _address(fs, name), _date_in(name[len(root) :]), (), _state(states)))
    return found


def _of_table(fs: Any, path: str, source: str) -> list[FleetBag]:
    folder = path.rpartition("/")[0]
    groups: dict[tuple[str, str, datetime | None], dict[str, str]] = {}
    for number, row in enumerate(_rows(fs, path, source), start=1):
        where = f"{source}, row {number}"
        robot, name = (str(row[key]).strip() if row[key] is not None else "" for key in ("robot", "bag"))
        if not robot or not name:
            raise InputError(f"{where}: no {'bag' if robot else 'robot'} is given")
        whole = name if "://" in name or name.startswith("/") else _address(fs, f"{folder}/{name}")
        joint, kind = (str(row.get(key) or "").strip() for key in ("joint", "kind"))
        joints = groups.setdefault((robot, whole, _time(row["time"], where)), {})
        if joint:
            joints[joint] = kind
        elif kind:
            raise InputError(f"{where}: kind {kind!r} without a joint; name the joint, or give --model by joint names")
    return [FleetBag(robot, bag, time, tuple(sorted(joints.items())), state_of(bag))
            for (robot, bag, time), joints in groups.items()]  # fmt: skip


def _rows(fs: Any, path: str, source: str) -> list[dict[str, Any]]:
    library("pyarrow.parquet")
    import pyarrow as pa
    from pyarrow import csv, parquet

    try:
        # In memory of Arrow: a thread of it that still holds an object of Python at exit ends the process by an abort.
        memory = pa.BufferOutputStream()
        memory.write(fs.cat_file(path))
        file = pa.BufferReader(memory.getvalue())
        # Robots and joints are names, also where they are written as numbers.
        names = csv.ConvertOptions(column_types=dict.fromkeys(("robot", "joint", "kind", "bag"), pa.string()))
        table = csv.read_csv(file, convert_options=names) if path.lower().endswith(".csv") else parquet.read_table(file)
    except FileNotFoundError:
        raise InputError(f"{source}: there is no such table, check the path") from None
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{source}: cannot be read as a table ({' '.join(str(error).split())})") from error
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        near = did_you_mean(missing[0], table.column_names)
        raise InputError(f"{source}: no column {listed(missing)}; it has {listed(table.column_names)}{near}")
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def _time(value: Any, where: str) -> datetime | None:
    """Time of a cell in UTC; None for an empty one."""
    if value is None or value == "":
        return None
    if isinstance(value, date) and not isinstance(value, datetime):
        value = datetime(value.year, value.month, value.day)  # noqa: DTZ001  (the zone follows)
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip().replace("Z", "+00:00"))
        except ValueError:
            raise InputError(f"{where}: time {value!r}: write 2026-03-01 or 2026-03-01 14:00:00") from None
    if not isinstance(value, datetime):
        raise InputError(f"{where}: time {value!r}: write 2026-03-01 or 2026-03-01 14:00:00")
    return value.replace(tzinfo=timezone.utc) if value.tzinfo is None else value.astimezone(timezone.utc)


def _date_in(text: str) -> datetime | None:
    """Last date in a path."""
    for year, month, day, *clock in reversed(_DATE.findall(text)):
        try:
            hour, minute, second = (int(one or 0) for one in clock)
            return datetime(int(year), int(month), int(day), hour, minute, second, tzinfo=timezone.utc)
        except ValueError:
            continue
    return None


def state_of(bag: str) -> str:
    """Return the stamp of a bag as it is now; empty where there is none."""
    fs, path = open_place(bag)
    try:
        return _state(fs.find(path, detail=True).values())
    except OSError:
        return ""


def _state(files: Iterable[Mapping[str, Any]]) -> str:
    several = list(files)
    changed = (next((str(one[key]) for key in _CHANGED if one.get(key)), "") for one in several)
    return f"{sum(int(one.get('size') or 0) for one in several)} {max(changed)}" if several else ""


def _address(fs: Any, path: str) -> str:
    return str(Path(path)) if "file" in fs.protocol else str(fs.unstrip_protocol(path))
