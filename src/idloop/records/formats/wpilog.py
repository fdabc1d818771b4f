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
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, check_size
from idloop.records.tables.table import Table
from idloop.spelling import listed

_MAGIC = b"WPILOG"
_START, _FINISH, _METADATA = 0, 1, 2
_NUMBERS = {"double": "d", "float": "f", "int64": "q", "boolean": "?"}
_TEXTS = ("string", "json")
# Types of the fields of a structure, as `struct` knows them.
_FIELDS = {
    "bool": "?", "char": "B", "int8": "b", "int16": "h", "int32": "i", "int64": "q", "uint8": "B", "uint16": "H",
    "uint32": "I", "uint64": "Q", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
_FIELD = re.compile(r"(?:enum\s*\{[^}]*\}\s*)?(\w+)\s+(\w+)(?:\s*\[\s*(\d+)\s*\])?")
_MOST_ARRAY = 256
_TEXT = 64  # bytes of a text beside its characters
# Names of units that SysId's logs have beside their entries.
_UNITS = {
    "Volt": "V", "Amp": "A", "Rotation": "rev", "Rotation per Second": "rev/s", "Radian": "rad",
    "Radian per Second": "rad/s", "Degree": "deg", "Degree per Second": "deg/s", "Meter": "m",
    "Meter per Second": "m/s",
}  # fmt: skip
_STATE, _NO_TEST = "sysid-test-state", ("none", "")
_SAME_TURN = 0.05  # share of a period within which stamps are of one turn of a loop
_Layout = list[tuple[str, str]]  # of the numbers of a record: what their names have behind that of the entry, and types


@dataclass
class _Entry:
    """One signal: its stamps [us] and values; of several numbers in a record one record after the other."""

    name: str
    type: str
    metadata: str
    stamps: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))
    texts: list[str] = field(default_factory=list)
    layout: _Layout | None = None  # None before the first record, empty where its length changes

    def columns(self) -> dict[str, Any]:
        """Return its columns by name."""
        if self.type in _TEXTS:
            return {self.name: self.texts}
        if not self.layout:
            return {}
        rows = np.array(self.values).reshape(-1, len(self.layout))
        return {f"{self.name}{name}": rows[:, place] for place, (name, _) in enumerate(self.layout)}


def read_wpilog(path: Path, _: Options) -> Table:
    """Read the entries of a data log."""
    check_size(path, "log fewer entries")
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


def _records(data: bytes, place: int) -> Iterator[tuple[int, int, int, bytes]]:
    """Yield where each record of a log ends, its entry, stamp and content; stop where one is cut off."""
    while place < len(data):
        lengths = data[place]
        wide = (lengths & 3) + 1, ((lengths >> 2) & 3) + 1, ((lengths >> 4) & 7) + 1
        begin = place + 1 + sum(wide)
        entry = int.from_bytes(data[place + 1 : place + 1 + wide[0]], "little")
        size = int.from_bytes(data[place + 1 + wide[0] : begin - wide[2]], "little")
        stamp = int.from_bytes(data[begin - wide[2] : begin], "little")
        place = begin + size
        if place > len(data):
            return
        yield place, entry, stamp, data[begin:place]


class _Log:
    """Collects the entries of a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._open: dict[int, _Entry] = {}
        self._entries: dict[str, _Entry] = {}
        self._schemas: dict[str, str] = {}
        self._layouts: dict[tuple[str, int], _Layout] = {}
        self._skipped: dict[str, None] = {}
        self._notes: list[str] = []
        self._bytes = 0

    def read(self, data: bytes, place: int) -> None:
        for end, entry, stamp, content in _records(data, place):
            if stamp >= 1 << 63 or (entry == 0 and not self._control(content)):
                break
            if entry in self._open:
                self._add(self._open[entry], stamp, content)
            place = end
        if place < len(data):
            self._notes.append(f"the last {len(data) - place:,} bytes hold no whole record and are left out")

    def _control(self, content: bytes) -> bool:
        """Follow a record about an entry; False where it is none."""
        if len(content) < 5:
            return False
        kind, number = content[0], int.from_bytes(content[1:5], "little")
        if kind == _FINISH:
            self._open.pop(number, None)
        elif kind == _START:
            texts, place = [], 5
            for _ in range(3):
                begin = place + 4
                place = begin + int.from_bytes(content[begin - 4 : begin], "little")
                texts.append(content[begin:place].decode("utf-8", "replace"))
            if place > len(content):
                return False
            name, type_, metadata = texts
            # An entry may start again, with a type of its own.
            whole = name if name not in self._entries or self._entries[name].type == type_ else f"{name} ({type_})"
            if whole not in self._entries and len(self._entries) >= MOST_COLUMNS:
                raise InputError(f"{self._path}: more than {MOST_COLUMNS:,} entries; check that this is the data file")
            self._open[number] = self._entries.setdefault(whole, _Entry(whole, type_, metadata))
        return kind in (_START, _FINISH, _METADATA)

    def _add(self, entry: _Entry, stamp: int, content: bytes) -> None:
        if entry.type == "structschema":
            self._schemas[entry.name.rpartition("struct:")[2]] = content[: 1 << 16].decode("utf-8", "replace")
            self._layouts.clear()
            return
        if entry.type in _TEXTS:
            entry.texts.append(content.decode("utf-8", "replace"))
            self._bytes += _TEXT + len(content)
        else:
            layout = self._layout(entry.type, len(content))
            if entry.layout is not None and entry.layout != layout and entry.type.endswith("[]"):
                # Of an array whose length changes, no element is a signal.
                entry.layout = []
            code = "<" + "".join(one for _, one in layout)
            whole = 0 < len(layout) <= _MOST_ARRAY and struct.calcsize(code) == len(content)
            if not whole or entry.layout not in (None, layout):
                self._skipped[entry.name] = None
                return
            entry.layout = layout
            entry.values.extend(struct.unpack(code, content))
            self._bytes += 8 * len(layout)
        entry.stamps.append(stamp)
        self._bytes += 16
        if self._bytes > MOST_TABLE:
            raise InputError(f"{self._path}: its entries take more than {MOST_TABLE >> 30} GiB; log fewer")

    def _layout(self, kind: str, size: int) -> _Layout:
        """Numbers of a record of so many bytes; none where it holds anything else."""
        key = kind, size
        if key not in self._layouts:
            code = _NUMBERS.get(kind.removesuffix("[]"), "")
            if not code:
                found = _fields(kind.removeprefix("struct:"), self._schemas, 0) if kind.startswith("struct:") else []
                self._layouts[key] = [(f".{name}", one) for name, one in found]
            elif kind in _NUMBERS:
                self._layouts[key] = [("", code)]
            else:
                count = min(size // struct.calcsize(code), _MOST_ARRAY + 1)
                self._layouts[key] = [(f"[{place}]", code) for place in range(count)]
        return self._layouts[key]

    def table(self) -> Table:
        """Return the entries as columns, each with the column of its stamps [s]."""
        table = Table(self._path, {}, notes=self._notes)
        clocks: dict[str, Array] = {}
        shared: list[str] = []
        for entry in self._entries.values():
            columns = entry.columns()
            if not columns or not entry.stamps:
                continue
            stamps = np.asarray(np.array(entry.stamps) * 1e-6, dtype=np.float64)
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
            if _STATE in entry.name and entry.texts:
                table.parts |= _tests(entry)
            if len(table.columns) > MOST_COLUMNS:
                raise InputError(f"{self._path}: more than {MOST_COLUMNS:,} columns; log fewer entries")
        if shared:
            table.notes.append(f"entries logged one after the other have the stamps of the first: {listed(shared)}")
        left_out = [name for name in self._skipped if name not in table.clocks]
        if left_out:
            table.notes.append(f"entries that hold neither numbers nor texts are left out: {listed(left_out)}")
        return table


def _are_of_one_loop(one: Array, other: Array) -> bool:
    """Whether two entries are logged one after the other in each turn of a loop."""
    if one.size != other.size or one.size < 3:
        return False
    return bool(np.abs(one - other).max() <= _SAME_TURN * np.median(np.diff(one)))


def _fields(name: str, schemas: dict[str, str], depth: int) -> _Layout:
    """Return names and types of the numbers of a structure, those of structures within it included."""
    found: _Layout = []
    for declared in schemas.get(name, "").split(";"):
        match = _FIELD.fullmatch(declared.strip())
        if match is None:
            if declared.strip():
                return []
            continue
        kind, own, count = match[1], match[2], int(match[3] or 0)
        if count > _MOST_ARRAY:
            return []
        within = _fields(kind, schemas, depth + 1) if kind not in _FIELDS and depth < 8 else []
        inner = [("", _FIELDS[kind])] if kind in _FIELDS else [(f".{part}", code) for part, code in within]
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
    stamps = [*entry.stamps, entry.stamps[-1] + 1]
    end = 0
    for state, records in groupby(entry.texts):
        begin, end = end, end + sum(1 for _ in records)
        if state in _NO_TEST or len(found) >= MOST_COLUMNS:
            continue
        name, again = state, 2
        while name in found:
            name, again = f"{state}-{again}", again + 1
        found[name] = (stamps[begin] * 1e-6, stamps[end] * 1e-6)
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
