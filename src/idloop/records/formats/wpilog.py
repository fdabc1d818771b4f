"""WPILib data logs: each entry a column with stamps of its own; the tests of SysId are records within the file.

A file is a header and records: the number of an entry, a size, a stamp in microseconds, and that many bytes. Entry 0
starts and ends the others. Source: WPILib, *Data Log File Format Specification*, version 1.0, and
*Struct Serialization Specification*.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options
from idloop.records.tables.table import Table
from idloop.spelling import listed

_MAGIC = b"WPILOG"
_START, _FINISH, _METADATA = 0, 1, 2
_NUMBERS = {"double": "d", "float": "f", "int64": "q", "boolean": "?"}
_TEXTS = ("string", "json")
# Types of the fields of a structure, as `struct` knows them.
_FIELDS = {
    "bool": "?", "char": "c", "int8": "b", "int16": "h", "int32": "i", "int64": "q", "uint8": "B", "uint16": "H",
    "uint32": "I", "uint64": "Q", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
_FIELD = re.compile(r"(?:enum\s*\{[^}]*\}\s*)?(\w+)\s+(\w+)(?:\s*\[\s*(\d+)\s*\])?")
_MOST_ARRAY = 256
_TEXT = 64
# Names of units that SysId's logs have beside their entries.
_UNITS = {
    "Volt": "V", "Amp": "A", "Rotation": "rev", "Rotation per Second": "rev/s", "Radian": "rad",
    "Radian per Second": "rad/s", "Degree": "deg", "Degree per Second": "deg/s", "Meter": "m",
    "Meter per Second": "m/s",
}  # fmt: skip
_STATE = "sysid-test-state"
# Share of a period within which stamps are of one turn of a loop.
_SAME_TURN = 0.05
_NO_TEST = ("none", "")


class _Record(NamedTuple):
    entry: int
    stamp: int
    content: memoryview


@dataclass
class _Entry:
    """One signal: its stamps [us] and values; of arrays one list after the other."""

    name: str
    type: str
    metadata: str
    stamps: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))
    texts: list[str] = field(default_factory=list)
    width: int = -1


def read_wpilog(path: Path, _: Options) -> Table:
    """Read the entries of a data log.

    Raises InputError: it is no data log, or too large.
    """
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; log fewer entries")
    data = path.read_bytes()
    if len(data) < 12 or not data.startswith(_MAGIC):
        raise InputError(f"{path}: not a WPILib data log; check the copy of the file")
    version, extra = struct.unpack_from("<HI", data, 6)
    if version >> 8 != 1 or 12 + extra > len(data):
        raise InputError(
            f"{path}: not a readable WPILib data log (version {version >> 8}.{version & 255}); check the copy"
        )
    log = _Log(path)
    log.read(data, 12 + extra)
    return log.table()


def _records(data: bytes, place: int) -> Iterator[tuple[int, _Record]]:
    """Yield the records of a log and where each ends; stop where one is cut off."""
    view = memoryview(data)
    while place < len(data):
        lengths = data[place]
        wide = (lengths & 3) + 1, ((lengths >> 2) & 3) + 1, ((lengths >> 4) & 7) + 1
        begin = place + 1 + sum(wide)
        if begin > len(data):
            return
        entry = int.from_bytes(data[place + 1 : place + 1 + wide[0]], "little")
        size = int.from_bytes(data[place + 1 + wide[0] : begin - wide[2]], "little")
        if begin + size > len(data):
            return
        stamp = int.from_bytes(data[begin - wide[2] : begin], "little")
        place = begin + size
        yield place, _Record(entry, stamp, view[begin:place])


class _Log:
    """Collects the entries of a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._open: dict[int, _Entry] = {}
        self._entries: dict[str, _Entry] = {}
        self._schemas: dict[str, str] = {}
        self._skipped: dict[str, None] = {}
        self._notes: list[str] = []
        self._bytes = 0

    def read(self, data: bytes, place: int) -> None:
        for end, record in _records(data, place):
            if record.stamp >= 1 << 63 or (record.entry == 0 and not self._control(record)):
                break
            if record.entry:
                self._add(record)
            place = end
        if place < len(data):
            self._notes.append(f"the last {len(data) - place:,} bytes hold no whole record and are left out")

    def _control(self, record: _Record) -> bool:
        """Follow a record about an entry; False where it is none."""
        content = bytes(record.content)
        if len(content) < 5:
            return False
        kind, number = content[0], int.from_bytes(content[1:5], "little")
        if kind == _FINISH:
            self._open.pop(number, None)
        elif kind == _START:
            texts, place = [], 5
            for _ in range(3):
                length = int.from_bytes(content[place : place + 4], "little")
                if place + 4 + length > len(content):
                    return False
                texts.append(content[place + 4 : place + 4 + length].decode("utf-8", "replace"))
                place += 4 + length
            name, type_, metadata = texts
            # An entry may start again, with a type of its own.
            whole = name if name not in self._entries or self._entries[name].type == type_ else f"{name} ({type_})"
            if whole not in self._entries and len(self._entries) >= MOST_COLUMNS:
                raise InputError(f"{self._path}: more than {MOST_COLUMNS:,} entries; check that this is the data file")
            self._open[number] = self._entries.setdefault(whole, _Entry(whole, type_, metadata))
        return kind in (_START, _FINISH, _METADATA)

    def _add(self, record: _Record) -> None:
        entry = self._open.get(record.entry)
        if entry is None:
            return
        kind, size = entry.type, len(record.content)
        if kind in _NUMBERS:
            if size == struct.calcsize(_NUMBERS[kind]):
                entry.values.append(struct.unpack(f"<{_NUMBERS[kind]}", record.content)[0])
                entry.stamps.append(record.stamp)
                self._count(16)
        elif kind in _TEXTS:
            entry.texts.append(bytes(record.content).decode("utf-8", "replace"))
            entry.stamps.append(record.stamp)
            self._count(16 + _TEXT + size)
        elif kind == "structschema":
            name = entry.name.rpartition("struct:")[2]
            self._schemas[name] = bytes(record.content[: 1 << 16]).decode("utf-8", "replace")
        elif kind.endswith("[]") and kind[:-2] in _NUMBERS:
            code = _NUMBERS[kind[:-2]]
            count = size // struct.calcsize(code)
            self._add_several(entry, record.stamp, struct.unpack_from(f"<{count}{code}", record.content))
        elif kind.startswith("struct:") and kind.removeprefix("struct:") in self._schemas:
            self._add_structure(entry, record)
        else:
            self._skipped[entry.name] = None

    def _add_several(self, entry: _Entry, stamp: int, values: tuple[float, ...]) -> None:
        if entry.width < 0:
            entry.width = len(values) if 0 < len(values) <= _MOST_ARRAY else 0
        if len(values) != entry.width:
            # Of an array whose length changes, no element is a signal.
            entry.width = 0
            self._skipped[entry.name] = None
            return
        entry.values.extend(values)
        entry.stamps.append(stamp)
        self._count(16 + 8 * len(values))

    def _add_structure(self, entry: _Entry, record: _Record) -> None:
        layout = _layout(entry.type.removeprefix("struct:"), self._schemas, 0)
        code = "<" + "".join(one for _, one in layout)
        if not layout or len(layout) > _MOST_ARRAY or struct.calcsize(code) != len(record.content):
            self._skipped[entry.name] = None
            return
        values = struct.unpack(code, record.content)
        entry.texts = [name for name, _ in layout]
        self._add_several(entry, record.stamp, tuple(ord(one) if isinstance(one, bytes) else one for one in values))

    def _count(self, size: int) -> None:
        self._bytes += size
        if self._bytes > MOST_TABLE:
            raise InputError(f"{self._path}: its entries take more than {MOST_TABLE >> 30} GiB; log fewer")

    def table(self) -> Table:
        """Return the entries as columns, each with the column of its stamps [s]."""
        table = Table(self._path, {}, notes=self._notes)
        clocks: dict[str, Array] = {}
        shared: list[str] = []
        for entry in self._entries.values():
            columns = self._columns(entry)
            if not columns or not entry.stamps:
                continue
            stamps = np.asarray(np.frombuffer(entry.stamps, dtype=np.int64) * 1e-6, dtype=np.float64)
            clock = next((name for name, known in clocks.items() if _are_of_one_loop(known, stamps)), "")
            table.columns |= columns
            if not clock:
                clock = f"{entry.name}.time"
                table.columns[clock] = clocks[clock] = stamps
                table.units[clock] = "s"
            elif not np.array_equal(clocks[clock], stamps):
                shared.append(entry.name)
            table.clocks |= dict.fromkeys(columns, clock)
            if entry.metadata and not entry.metadata.lstrip().startswith("{"):
                table.units |= dict.fromkeys(columns, _UNITS.get(entry.metadata, entry.metadata))
            if _STATE in entry.name and entry.texts and entry.type in _TEXTS:
                table.parts |= _tests(entry)
            if len(table.columns) > MOST_COLUMNS:
                raise InputError(f"{self._path}: more than {MOST_COLUMNS:,} columns; log fewer entries")
        if shared:
            table.notes.append(f"entries logged one after the other have the stamps of the first: {listed(shared)}")
        left_out = [name for name in self._skipped if name not in table.clocks]
        if left_out:
            table.notes.append(f"entries that hold neither numbers nor texts are left out: {listed(left_out)}")
        return table

    def _columns(self, entry: _Entry) -> dict[str, Any]:
        if entry.type in _TEXTS:
            return {entry.name: entry.texts}
        values = np.frombuffer(entry.values, dtype=np.float64) if entry.values else np.empty(0)
        if entry.type in _NUMBERS:
            return {entry.name: values}
        if entry.width <= 0:
            return {}
        rows = values.reshape(-1, entry.width)
        names = [f".{name}" for name in entry.texts] or [f"[{place}]" for place in range(entry.width)]
        return {f"{entry.name}{name}": rows[:, place] for place, name in enumerate(names)}


def _are_of_one_loop(one: Array, other: Array) -> bool:
    """Whether two entries are logged one after the other in each turn of a loop."""
    if one.size != other.size or one.size < 3:
        return False
    return bool(np.abs(one - other).max() <= _SAME_TURN * np.median(np.diff(one)))


def _layout(name: str, schemas: dict[str, str], depth: int) -> list[tuple[str, str]]:
    """Return names and types of the numbers of a structure, those of structures within it included."""
    found: list[tuple[str, str]] = []
    for declared in schemas.get(name, "").split(";"):
        match = _FIELD.fullmatch(declared.strip())
        if match is None:
            if declared.strip():
                return []
            continue
        kind, own, count = match[1], match[2], int(match[3] or 0)
        if count > _MOST_ARRAY:
            return []
        inner = [("", _FIELDS[kind])] if kind in _FIELDS else [
            (f".{part}", code) for part, code in (_layout(kind, schemas, depth + 1) if depth < 8 else [])
        ]  # fmt: skip
        if not inner:
            return []
        places = [f"[{place}]" for place in range(count)] if count else [""]
        found += [(f"{own}{place}{part}", code) for place in places for part, code in inner]
        if len(found) > _MOST_ARRAY:
            return []
    return found


def _tests(entry: _Entry) -> dict[str, tuple[float, float]]:
    """Return the tests of SysId: their stamps [s] from the first record of a state to the first of the next."""
    found: dict[str, tuple[float, float]] = {}
    begin = 0
    for k in range(1, len(entry.texts) + 1):
        if k < len(entry.texts) and entry.texts[k] == entry.texts[begin]:
            continue
        state = entry.texts[begin]
        if state not in _NO_TEST and len(found) < MOST_COLUMNS:
            name, again = state, 2
            while name in found:
                name, again = f"{state}-{again}", again + 1
            stop = entry.stamps[k] if k < len(entry.texts) else entry.stamps[-1] + 1
            found[name] = (entry.stamps[begin] * 1e-6, stop * 1e-6)
        begin = k
    return found


FORM = Form(
    "wpilog",
    (".wpilog",),
    "WPILib data log",
    "entries by name, elements of arrays `name[0]`, fields of structures `name.x`; with their stamps in `name.time`"
    " [s], which entries of one loop share; the tests of SysId are parts by the names of their states",
    lambda head: head.startswith(_MAGIC),
    read_wpilog,
)
