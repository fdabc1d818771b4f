"""Columns of nested arrays, and the stamps that belong to them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_DEPTH
from idloop.errors import InputError
from idloop.records.recognition.column_name import parse_column_name
from idloop.records.recognition.roles import role_by_name
from idloop.records.tables.base_units import TIME_WORDS, clock_unit, is_unit_key, known_clock_unit, known_unit
from idloop.records.tables.table import Table
from idloop.spelling import joined_names

# Entries of a structure or cell array that become columns of their own; a longer one is a list of samples.
_MOST_PARTS = 256
# What a series with gaps holds.
_CELL = (int, float, type(None))
# Lists of what was recorded at the same time, and no runs, by the word of their name.
_BESIDE_EACH_OTHER = {
    "joint", "joints", "motor", "motors", "axis", "axes", "servo", "servos", "actuator", "actuators", "channel",
    "channels", "signal", "signals", "topic", "topics", "series", "traces",
}  # fmt: skip
_FEWEST_ROWS = 3  # of a run
_MATRIX = 2  # dimensions
_LAST_BLOCK = re.compile(r"(?:[^/]|//)*$")


def table_of_tree(path: Path, tree: Mapping[str, Any], *, separator: str = ".", clocks: bool = False) -> Table:
    """Flatten nested arrays into columns named ``a.b``, ``a[0]`` and ``a[0].b``, single values into attributes.

    A series called time in a structure holds the stamps of the other series of its length there, deeper ones included.

    `clocks`: whether a series called time at the top belongs to the other series there, too.
    Raises InputError: more than `MOST_COLUMNS` columns, or nested more than `MOST_DEPTH` deep.
    """
    table = Table(path, {})
    _Flattener(table, separator).add(_named(tree), "", 0, clocks=clocks)
    return table


class _Flattener:
    """Fills a table from a tree."""

    def __init__(self, table: Table, separator: str) -> None:
        self._table, self._separator = table, separator

    def add(self, tree: Mapping[str, Any], prefix: str, depth: int, *, clocks: bool = True) -> None:
        if depth > MOST_DEPTH:
            raise InputError(f"{self._table.path}: structures more than {MOST_DEPTH} deep; check that this is the file")
        before = len(self._table.columns)
        own = []
        for name, value in tree.items():
            own += self._entry(str(name), value, prefix, depth)
            if len(self._table.columns) + len(self._table.attributes) > MOST_COLUMNS:
                raise InputError(
                    f"{self._table.path}: more than {MOST_COLUMNS:,} series and values; check that this is the file"
                )
        self._note_unit(tree, prefix, own)
        inner = list(self._table.columns)[before:]
        if clocks or self._table.clocks.keys() & inner:
            self._set_clock([(full, short) for full, short in own if full in self._table.columns], inner)
        else:
            self._set_clocks_of_lengths([one for one in own if one[0] in self._table.columns])

    def _entry(self, name: str, value: Any, prefix: str, depth: int) -> list[tuple[str, str]]:
        """Add one entry; return the names of its columns, whole and within its structure."""
        table, full = self._table, prefix + name
        if isinstance(value, np.ndarray) and value.dtype.names:
            value = {field: value[field] for field in value.dtype.names}
        if isinstance(value, Mapping):
            self.add(_named(value), full + self._separator, depth + 1)
            return []
        if (parts := _parts(value)) is not None:
            self.add(_elements(name, parts), prefix, depth + 1, clocks=False)
            return []
        if isinstance(value, str):
            table.attributes[full] = value
            return []
        texts = isinstance(value, list | tuple) and value and all(isinstance(one, str) for one in value)
        gaps = isinstance(value, list) and all(isinstance(one, _CELL) for one in value) and None in value
        if texts or gaps:
            table.columns[full] = list(value)
            return [(full, name)]
        try:
            array = np.asarray(value)
        except (ValueError, OverflowError, TypeError):
            return []
        if array.dtype.kind not in "biufU":
            return []
        array = np.squeeze(array) if array.ndim > 1 else array
        if array.ndim == 0:
            table.attributes[full] = str(array) if array.dtype.kind == "U" else float(array)
            return []
        if array.ndim > _MATRIX:
            size = " x ".join(map(str, array.shape))
            table.notes.append(f"{full!r} has {size} values and is left out; save a matrix or a file for each record")
        tall = _tall(array)
        columns = {full: array} if array.ndim == 1 else {} if tall is None else _elements(full, tall.T)
        table.columns |= columns
        return [(column, name) for column in columns]

    def _set_clock(self, own: list[tuple[str, str]], inner: list[str]) -> None:
        table = self._table
        clock = next(((full, unit) for full, short in own if (unit := clock_unit(short)) is not None), None)
        if clock is None:
            return
        name, unit = clock
        if unit and not known_clock_unit(table.units.get(name, "")):
            table.units[name] = unit
        length = len(table.columns[name])
        used = set(table.clocks.values())
        for column in inner:
            if column != name and column not in used and len(table.columns[column]) == length:
                table.clocks.setdefault(column, name)

    def _set_clocks_of_lengths(self, own: list[tuple[str, str]]) -> None:
        """Give series of several lengths the stamps of theirs: ``t_a`` and ``t_b``, one clock for each length."""
        table, clocks = self._table, dict[int, list[str]]()
        for full, short in own:
            column, words = table.columns[full], set(re.split(r"[\W_\d]+", short.lower()))
            if not (words & TIME_WORDS and isinstance(column, np.ndarray) and column.dtype.kind in "iuf"):
                continue
            if column.size > 1 and (np.diff(column.astype(np.float64)) > 0.0).all():
                clocks.setdefault(len(column), []).append(full)
        if len(clocks) < 2 or any(len(several) > 1 for several in clocks.values()):
            return
        for full, _ in own:
            (clock,) = clocks.get(len(table.columns[full]), [full])
            if clock != full:
                table.clocks.setdefault(full, clock)

    def _note_unit(self, tree: Mapping[str, Any], prefix: str, own: list[tuple[str, str]]) -> None:
        """Keep the units that a structure says of its series, that of MATLAB of its Data, or a table of its columns."""
        said = next((value for key, value in tree.items() if is_unit_key(str(key))), None)
        for several in (tree.get("VariableUnits"), said):
            if isinstance(several, Mapping):
                self._table.units |= {f"{prefix}{name}": str(unit) for name, unit in several.items()}
        if isinstance(said, str) and prefix:
            # Stamps beside a series have a unit of their own.
            series = [full for full, short in own if clock_unit(short) is None or len(own) == 1]
            self._table.units |= dict.fromkeys(series, said)
        info = tree.get("DataInfo")
        unit = info.get("Units") if isinstance(info, Mapping) else None
        if isinstance(unit, str) and unit:
            for name in self._table.columns:
                if name == f"{prefix}Data" or name.startswith(f"{prefix}Data["):
                    self._table.units[name] = unit


def _elements(name: str, several: Iterable[Any]) -> dict[str, Any]:
    return {f"{name}[{place}]": one for place, one in enumerate(several)}


def _named(tree: Mapping[str, Any]) -> Mapping[str, Any]:
    """Name the signals of Simulink by their labels, those of a data set by their names."""
    signals = tree.get("signals")
    if "time" in tree and signals is not None:
        several = signals if isinstance(signals, list | tuple | np.ndarray) else [signals]
        if all(isinstance(one, Mapping) and "values" in one for one in several):
            labels = [one.get("label") for one in several]
            distinct = len(set(map(str, labels))) == len(labels)
            found = {
                label if isinstance(label, str) and label and distinct else f"signals[{place}]": one["values"]
                for place, (label, one) in enumerate(zip(labels, several, strict=True))
            }
            if len(several) == 1 and "signals[0]" in found:
                # Without a label the block that gave a signal may say what it is: axis/Speed, but not axis/Scope.
                block = last_block(str(tree.get("blockName", "")))
                named = role_by_name(parse_column_name(block)).role not in ("", "other")
                found = {block if named else "signals": found["signals[0]"]}
            return {"time": tree["time"], **found, **{k: v for k, v in tree.items() if k not in ("time", "signals")}}
    return _with_names({key: _by_name(value) for key, value in tree.items()})


def last_block(path: str) -> str:
    """Return the name of the last block on a path of Simulink, which writes a stroke in a name twice."""
    block = _LAST_BLOCK.findall(path)[0].replace("//", "/")
    return f"[{block}]" if known_unit(block) else block.replace("/", " ").replace("\n", " ")


def _with_names(tree: Mapping[str, Any]) -> Mapping[str, Any]:
    """Name the columns of a matrix by a list of as many texts beside it."""
    lists = {key: words for key, value in tree.items() if len(words := _words(value)) > 1}
    found: dict[str, Any] = {}
    used = set()
    for key, value in tree.items():
        matrix = _tall(value) if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" else None
        fitting = [one for one, words in lists.items() if matrix is not None and len(words) == matrix.shape[1]]
        if matrix is None or len(fitting) != 1:
            found[key] = value
            continue
        used.add(fitting[0])
        for name, column in zip(lists[fitting[0]], matrix.T, strict=True):
            found[name if name not in tree and name not in found else f"{key}.{name}"] = column
    return {key: value for key, value in found.items() if key not in used}


def _words(value: Any) -> list[str]:
    """Names in a list, a cell array or the rows of an array of characters; none where it is anything else."""
    if not isinstance(value, list | tuple | np.ndarray) or (isinstance(value, np.ndarray) and value.ndim != 1):
        return []
    if not 0 < len(value) <= MOST_COLUMNS or not isinstance(value[0], str):
        return []
    words = [one.strip() if isinstance(one, str) else "" for one in value]
    return words if all(words) and len(set(words)) == len(words) else []


def _tall(value: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
    """A matrix with a row for each sample, along its longer axis; None where it is no matrix."""
    matrix = np.squeeze(value)
    if matrix.ndim != 2 or min(matrix.shape) > MOST_COLUMNS:
        return None
    return matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T


def _entries(value: Any) -> list[Any]:
    """Entries of a structure array or a cell array; none for anything else."""
    if isinstance(value, np.ndarray) and (value.dtype.kind != "O" or value.ndim != 1):
        return []
    several = isinstance(value, list | tuple | np.ndarray) and len(value) <= _MOST_PARTS
    return list(value) if several else []


def _by_name(value: Any) -> Any:
    """Return elements of a data set by name, where each has a name and a series of values; else the value itself."""
    several = [value] if isinstance(value, Mapping) else _entries(value)
    if not all(isinstance(one, Mapping) and isinstance(one.get("Values"), Mapping) for one in several):
        return value
    names = [one.get("Name") for one in several]
    if names and all(isinstance(name, str) and name for name in names) and len(set(names)) == len(names):
        return {name: one["Values"] for name, one in zip(names, several, strict=True)}
    return value


def _parts(value: Any) -> list[Any] | None:
    """Entries of a structure array, or of a cell array of series of several lengths; None for anything else."""
    several = _entries(value)
    if several and all(isinstance(part, Mapping) for part in several):
        return several
    return several if all(map(_is_series, several)) and len({len(part) for part in several}) > 1 else None


def _is_series(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and value.dtype.kind != "O"
    return isinstance(value, list) and not any(isinstance(one, list | tuple | Mapping | np.ndarray) for one in value)


def runs_in(content: Any, key: str | None = None) -> tuple[list[Any], list[str], dict[str, Any]] | None:
    """Return a list of runs, under a key or any, with the names of their arrays and what stands beside it, or None."""
    if not isinstance(content, Mapping):
        names = _arrays_of_runs("", content, {})
        return (content, names, {}) if names else None
    for place in content if key is None else [key]:
        beside = {name: value for name, value in content.items() if name != place}
        if names := _arrays_of_runs(str(place), content[place], beside):
            return content[place], names, beside
    return None


def _arrays_of_runs(name: str, value: Any, others: Mapping[str, Any]) -> list[str]:
    """Return the arrays that each run has, of one length in a run; empty where a list is none of runs.

    Samples with vectors are more than the vectors are long, and all of theirs are of one length. Signals are named.
    An array beside the list of the length of the runs belongs to all, as the stamps of several joints do.
    """
    if not isinstance(value, list) or not value or not all(isinstance(run, Mapping) for run in value):
        return []
    lengths = [{key: len(one) for key, one in run.items() if _is_array(one)} for run in value]
    names = [key for key in lengths[0] if all(key in one for one in lengths)]
    rows = [max((one[key] for key in names), default=0) for one in lengths]
    names = [key for key in names if all(one[key] == count for one, count in zip(lengths, rows, strict=True))]
    if len(names) < 2 or min(rows) < _FEWEST_ROWS or (len(set(rows)) == 1 and rows[0] <= len(value)):
        return []
    beside = set(parse_column_name(name).words) & _BESIDE_EACH_OTHER
    beside |= {key for key, one in others.items() if _is_array(one) and len(one) in rows}
    texts = [key for key, one in value[0].items() if isinstance(one, str)]
    roles = {role_by_name(parse_column_name(str(run.get(key)))).role for run in value for key in texts}
    return [] if beside or roles & {"command", "position", "velocity"} else names


def table_of_runs(path: Path, runs: list[Mapping[str, Any]], names: list[str], others: Mapping[str, Any]) -> Table:
    """Return the named arrays of runs one after the other, with the rows at which a run begins."""
    table = table_of_tree(path, {name: list(chain.from_iterable(run[name] for run in runs)) for name in names})
    table.begins = tuple(accumulate((len(run[names[0]]) for run in runs[:-1]), initial=0))
    table.attributes = table_of_tree(path, others).attributes
    if len(runs) > 1:
        table.notes.append(f"it holds a list of {len(runs)} runs, each with {joined_names(names)}")
    return table


def _is_array(value: Any) -> bool:
    return isinstance(value, list) or (isinstance(value, np.ndarray) and value.ndim > 0)
