"""Objects in MATLAB files: timetable, table, timeseries, data sets of Simulink, and the properties of others.

A variable that is an object holds numbers of objects. Their classes and properties lie in one array of cells, the
subsystem: the first cell has tables of names, classes, objects and properties, the others the values. MathWorks does
not publish this; source: foreverallama, *matio*, documents "Subsystem Data Format" and "Field Contents".
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Integers
from idloop.documents import MOST_DEPTH, MOST_TABLE
from idloop.records.formats.tree import last_block

_SIGN = 0xDD000000
_HEAD = 40  # bytes: version, number of names, eight places of tables
_FIRST = 2  # cell of value 0
_MOST = 100_000  # objects


@dataclass(frozen=True)
class Reference:
    """What a variable holds whose value is an object or an array of objects."""

    numbers: Integers  # a sign, the number of dimensions, the dimensions, the objects, their class

    @property
    def objects(self) -> list[int]:
        """Numbers of the objects, from 1; empty where it is none."""
        several: list[int] = self.numbers.tolist()
        if len(several) < 4 or several[0] != _SIGN or not 0 < several[1] <= 8:
            return []
        return several[2 + several[1] : -1]


class Objects:
    """Objects of one file, by the cells of the subsystem, with a `Reference` for an object within them.

    Raises ValueError, struct.error: its tables are damaged.
    """

    def __init__(self, cells: list[Any]) -> None:
        self._cells = cells
        self._open: set[int] = set()
        self._count = 0
        self._classes: list[str] = []
        self._objects: list[tuple[int, ...]] = []
        self._saved: list[list[tuple[int, int, int]]] = []
        self._plain: list[list[tuple[int, int, int]]] = []
        self._names: list[str] = []
        self.unread: list[str] = []
        if cells:
            self._read_tables(np.asarray(cells[0], dtype=np.uint8).tobytes())

    def _read_tables(self, data: bytes) -> None:
        _, count, *places = struct.unpack_from("<10i", data)
        self._names = [one.decode("utf-8", "replace") for one in data[_HEAD : places[0]].split(b"\0")[:count]]
        classes = struct.iter_unpack("<4i", data[places[0] : places[1]])
        self._classes = [self._name(one[1]) for one in classes]
        self._saved = _properties(data[places[1] : places[2]])
        self._objects = list(struct.iter_unpack("<6i", data[places[2] : places[3]]))
        self._plain = _properties(data[places[3] : places[4]])

    def _name(self, number: int) -> str:
        return self._names[number - 1] if 0 < number <= len(self._names) else ""

    def resolved(self, value: Any, name: str = "", depth: int = 0) -> Any:
        """Return a value with the content of each object in its place; None for one that is not known."""
        if depth > MOST_DEPTH:
            return None
        if isinstance(value, np.ndarray) and value.dtype == np.uint32 and value.size > 3 and value.flat[0] == _SIGN:
            value = Reference(value.ravel().astype(np.int64))
        if isinstance(value, Reference):
            several = [self._object(one, name, depth) for one in value.objects[:_MOST]]
            if depth == 0 and all(one is None for one in several):
                self.unread.append(name)
            return several[0] if len(several) == 1 else several or None
        if isinstance(value, Mapping):
            return {key: self.resolved(one, name, depth + 1) for key, one in value.items()}
        if isinstance(value, list):
            return [self.resolved(one, name, depth + 1) for one in value]
        return value

    def _object(self, number: int, name: str, depth: int) -> Any:
        self._count += 1
        if not 0 < number < len(self._objects) or number in self._open or self._count > _MOST:
            return None
        kind, _, _, saved, plain, _ = self._objects[number]
        blocks, place = (self._saved, saved) if saved > 0 else (self._plain, plain)
        if not (0 <= kind < len(self._classes) and 0 <= place < len(blocks)):
            return None
        self._open.add(number)
        try:
            found = {}
            for key, flag, content in blocks[place]:
                if flag == 1 and 0 <= content < len(self._cells) - _FIRST:
                    found[self._name(key)] = self.resolved(self._cells[content + _FIRST], name, depth + 1)
                elif flag != 1:
                    found[self._name(key)] = self._name(content) if flag == 0 else float(content)
        finally:
            self._open.discard(number)
        read = _CLASSES.get(self._classes[kind])
        known = read(found) if read else found
        return known if isinstance(known, np.ndarray) or known else None


def _properties(data: bytes) -> list[list[tuple[int, int, int]]]:
    """Return the properties of each object: name, whether the value is a cell, and which."""
    found, place = [], 0
    while place + 8 <= len(data):
        (count,) = struct.unpack_from("<i", data, place)
        if not 0 <= count <= (len(data) - place - 4) // 12:
            raise ValueError("a table of properties is damaged")
        numbers = struct.unpack_from(f"<{3 * count}i", data, place + 4)
        found.append(list(zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)))
        place += -(-(4 + 12 * count) // 8) * 8
    return found


def listed_cells(value: Any) -> list[Any]:
    """Return the entries of a cell array; of one that was simplified to its only entry, that."""
    if isinstance(value, list):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        return list(value.ravel())
    return [] if value is None or (isinstance(value, np.ndarray) and not value.size) else [value]


def _named_columns(names: Any, data: Any, units: Any) -> dict[str, Any]:
    keys = [str(name) for name in listed_cells(names)]
    # A single column that is a list was simplified to it.
    columns = data if isinstance(data, list) and len(data) == len(keys) else [data]
    if not keys or len(columns) != len(keys):
        return {}
    found = dict(zip(keys, columns, strict=True))
    said = {key: unit for key, unit in zip(keys, listed_cells(units), strict=False) if isinstance(unit, str) and unit}
    return found | ({"VariableUnits": said} if said else {})


def _timetable(found: dict[str, Any]) -> Any:
    inner = found.get("any")
    if not isinstance(inner, Mapping):
        return None
    columns = _named_columns(inner.get("varNames"), inner.get("data"), inner.get("varUnits"))
    times = inner.get("rowTimes")
    if isinstance(times, Mapping):
        times = _even_times(times, inner.get("numRows"))
    return {"Time": times, **columns} if columns and isinstance(times, np.ndarray) else None


def _even_times(times: Mapping[str, Any], count: Any) -> Any:
    """Stamps that are kept as an origin and a step or rate."""
    origin, step, rate, rows = map(
        _number, (times.get("origin"), times.get("stepSize"), times.get("sampleRate"), count)
    )
    step = 1.0 / rate if rate else step
    return (origin or 0.0) + step * np.arange(int(rows)) if step and rows and 0 < rows <= MOST_TABLE / 8 else None


def _number(value: Any) -> float | None:
    """Return the first number of an array; None where it has none that is finite."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or not array.size or not np.isfinite(array.flat[0]):
        return None
    return float(array.flat[0])


def _table(found: dict[str, Any]) -> Any:
    properties = found.get("props")
    units = properties.get("VariableUnits") if isinstance(properties, Mapping) else None
    return _named_columns(found.get("varnames"), found.get("data"), units)


def _timeseries(found: dict[str, Any]) -> Any:
    data = next((found[key] for key in ("Data_", "Data") if isinstance(found.get(key), np.ndarray)), None)
    if data is None or not data.size:
        return None
    info = found.get("TimeInfo")
    info = info if isinstance(info, Mapping) else {}
    places = ((found, "Time_"), (found, "Time"), (info, "Time_"))
    time = next((one[key] for one, key in places if isinstance(one.get(key), np.ndarray) and one[key].size), None)
    if time is None:
        step = {
            "origin": info.get("Start_", info.get("Start")),
            "stepSize": info.get("Increment_", info.get("Increment")),
        }
        time = _even_times(step, max(data.shape))
    if not isinstance(time, np.ndarray):
        return None
    units = found.get("DataInfo")
    return {"Time": time, "Data": data} | ({"DataInfo": units} if isinstance(units, Mapping) else {})


def _dataset(found: dict[str, Any]) -> Any:
    """Signals that Simulink has logged, by their names, or by the last block of the path to each."""
    elements: Any = found
    for key in ("any", "Storage", "any", "Elements"):
        elements = elements.get(key) if isinstance(elements, Mapping) else None
    several = [one for one in listed_cells(elements) if isinstance(one, Mapping)]
    several = [one for one in several if isinstance(one.get("Values"), Mapping)]
    names = [_signal_name(one) for one in several]
    distinct = len(set(names)) == len(names)
    return {
        name if name and distinct else f"signals[{place}]": one["Values"]
        for place, (name, one) in enumerate(zip(names, several, strict=True))
    } or found


def _signal_name(element: Mapping[str, Any]) -> str:
    if isinstance(name := element.get("Name"), str) and name:
        return name
    path = element.get("BlockPath")
    path = path.get("path") if isinstance(path, Mapping) else path
    path = path[-1] if isinstance(path, list) and path else path
    return last_block(path) if isinstance(path, str) else ""


def _seconds(millis: Any) -> Any:
    # The imaginary part of a date is far below a microsecond.
    return np.real(np.asarray(millis, dtype=complex)) / 1000.0 if millis is not None else None


def _string(found: dict[str, Any]) -> Any:
    numbers = np.asarray(found.get("any"))
    if numbers.dtype.kind not in "ui" or numbers.size < 2:
        return None
    several = numbers.ravel().astype(np.uint64)
    dimensions = int(several[1])
    if not 0 < dimensions <= 8 or several.size < 2 + dimensions:
        return None
    count = int(np.prod(several[2 : 2 + dimensions].astype(object)))
    begin = 2 + dimensions + count
    if not 0 < count <= several.size or several.size < begin:
        return None
    text = several[begin:].tobytes()
    found_texts, place = [], 0
    for length in several[2 + dimensions : begin].tolist():
        stop = place + 2 * min(length, len(text))
        found_texts.append(text[place:stop].decode("utf-16-le", "replace"))
        place = stop
    return found_texts[0] if count == 1 else found_texts


def _categorical(found: dict[str, Any]) -> Any:
    names = [str(name) for name in listed_cells(found.get("categoryNames"))]
    codes = np.asarray(found.get("codes"))
    if codes.dtype.kind not in "iu":
        return None
    return [names[code - 1] if 0 < code <= len(names) else "" for code in codes.ravel().tolist()]


_CLASSES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "timetable": _timetable, "table": _table, "timeseries": _timeseries,
    "duration": lambda found: _seconds(found.get("millis")), "datetime": lambda found: _seconds(found.get("data")),
    "string": _string, "categorical": _categorical, "Dataset": _dataset,
}  # fmt: skip
