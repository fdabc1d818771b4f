"""CSV, MAT, NPZ and JSON files as named columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.documents import MOST_JSON_TABLE, MOST_TABLE, read_json, read_npz, read_text
from idloop.errors import InputError
from idloop.records.tables.csv_file import CsvTable, read_csv
from idloop.spelling import did_you_mean, listed

# Entries of a structure or cell array that become columns of their own; a longer one is a list of samples.
_MOST_PARTS = 256
FORMATS = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".dat": "csv", ".mat": "mat", ".npz": "npz", ".json": "json"}


@dataclass
class Table:
    """Columns of a file, converted to numbers only when asked for.

    Parameters
    ----------
    path : Path
        Where it came from, for messages.
    columns : dict of str to list of str or ndarray
        Raw columns in the order of the file.
    attributes : dict of str to float or str
        Single values beside the columns.
    notes : list of str
        What was found out about the format of the file.
    units : dict of str to str
        Units of columns, as the file writes them.
    clocks : dict of str to str
        Where columns have stamps of their own: the column that holds those of each.
    first_row : int
        Row of the file with which the columns begin.
    csv : CsvTable or None
        Of a text file, what was found about its layout.
    """

    path: Path
    columns: dict[str, Any]
    attributes: dict[str, float | str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    first_row: int = 0
    csv: CsvTable | None = None

    def __contains__(self, name: str | int) -> bool:
        """Whether there is such a column, by name or by position from 0."""
        return 0 <= name < len(self.columns) if isinstance(name, int) else name in self.columns

    def raw(self, name: str | int) -> Any:
        """Return a column as read, by name or by position from 0."""
        if isinstance(name, int):
            if name not in self:
                raise InputError(f"{self.path}: no column {name}; there are {len(self.columns)}, counted from 0")
            return list(self.columns.values())[name]
        if name not in self:
            raise InputError(
                f"{self.path}: no column {name!r}; it has {listed(self.columns)}{did_you_mean(name, self.columns)}"
            )
        return self.columns[name]

    def numbers(self, name: str | int, rows: slice = slice(None)) -> NDArray[np.float64]:
        """Return a column, or some rows of it, as floats (n,); an empty cell is NaN.

        Raises
        ------
        InputError
            Unknown column, or a cell that is no number.
        """
        raw = self.raw(name)[rows]
        try:
            return np.asarray(raw, dtype=np.float64).ravel()
        except (TypeError, ValueError):
            first = self.first_row + (rows.start or 0)
            return np.array([self._number(cell, name, first + row) for row, cell in enumerate(raw)])

    def _number(self, cell: Any, name: str | int, row: int) -> float:
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            return float("nan")
        try:
            return float(cell)
        except (TypeError, ValueError):
            advice = ', set `csv: {decimal: ","}` if it has a decimal comma' if "," in str(cell) else ""
            raise InputError(
                f"{self.path}: row {row} of column {name!r} is {str(cell)[:40]!r}, not a number;"
                f" correct the file{advice} or choose another column"
            ) from None


def read_table(path: Path, kind: str | None = None, options: Mapping[str, Any] | None = None) -> Table:
    """Read a file into columns.

    Parameters
    ----------
    path : Path
        The file.
    kind : {"csv", "mat", "npz", "json"}, optional
        Format; by default from the file's suffix.
    options : mapping, optional
        ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``, ``rows`` (csv: slice of the rows that are
        looked at); ``entries`` (json: key of the list of samples).

    Raises
    ------
    InputError
        Missing or unreadable file, unknown format, no rows.
    """
    options = dict(options or {})
    if not path.is_file():
        near = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        raise InputError(f"{path}: no such file{did_you_mean(path.name, near) or '; check the path'}")
    try:
        path.open("rb").close()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    kind = kind or FORMATS.get(path.suffix.lower())
    readers = {"csv": _read_csv, "mat": _read_mat, "npz": _read_npz, "json": _read_json}
    if kind not in readers:
        raise InputError(
            f"{path}: unknown format {path.suffix!r}; known are {listed(FORMATS)}, or set `format:` in the mapping"
        )
    table = readers[kind](path, options)
    if not table.columns:
        raise InputError(f"{path}: no columns of numbers found; check that this is the data file")
    # Elements without a size may form an array of any length.
    if 8 * sum(len(column) for column in table.columns.values()) > MOST_TABLE:
        raise InputError(f"{path}: its columns take more than {MOST_TABLE >> 30} GiB; cut the file")
    if not any(len(column) for column in table.columns.values()):
        raise InputError(
            f"{path}: there are no rows of data, only the names of columns ({listed(table.columns)});"
            " check that the recording was saved whole"
        )
    return table


def _read_csv(path: Path, options: dict[str, Any]) -> Table:
    rows = options.get("rows") or slice(0, None)
    read = read_csv(path, options, rows)
    return Table(path, read.columns, notes=read.notes, units=read.units, first_row=rows.start or 0, csv=read)


def _read_mat(path: Path, _: dict[str, Any]) -> Table:
    from scipy.io import loadmat

    from idloop.records.tables.mat_structure import mat_damage

    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; save fewer variables in it")
    try:
        damage = mat_damage(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if damage:
        raise InputError(f"{path}: not a readable MAT file ({damage}); check the copy of the file")
    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise InputError(
            f"{path}: a MAT file of version 7.3 (HDF5); save it again in MATLAB with: save(file, '-v7')"
        ) from None
    except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
        raise InputError(
            f"{path}: not a readable MAT file ({type(error).__name__}); check the copy of the file"
        ) from None
    opaque = next((name for name, value in content.items() if type(value).__name__ == "MatlabOpaque"), None)
    table = _from_tree(path, {name: value for name, value in content.items() if not name.startswith("__")})
    if not table.columns and opaque is not None:
        raise InputError(
            f"{path}: {opaque!r} is a MATLAB object (timeseries, table), which only MATLAB reads; save its Time"
            " and Data as plain arrays"
        )
    return table


def _read_npz(path: Path, _: dict[str, Any]) -> Table:
    return _from_tree(path, read_npz(path, MOST_TABLE))


def _read_json(path: Path, options: dict[str, Any]) -> Table:
    content = read_json(read_text(path, MOST_JSON_TABLE), str(path), MOST_JSON_TABLE)
    attributes: dict[str, float | str] = {}
    entries = content
    if isinstance(content, dict):
        attributes = {name: value for name, value in content.items() if isinstance(value, int | float | str)}
    key = options.get("entries")
    if key is not None:
        if not isinstance(content, dict) or key not in content:
            have = list(content) if isinstance(content, dict) else []
            raise InputError(f"{path}: no key {key!r} with the samples; it has {listed(have)}{did_you_mean(key, have)}")
        entries = content[key]
    if isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries):
        names = dict.fromkeys(name for entry in entries for name in entry)
        return Table(path, {name: [entry.get(name) for entry in entries] for name in names}, attributes)
    if isinstance(entries, dict):
        table = _from_tree(path, entries)
        table.attributes = attributes | table.attributes
        return table
    raise InputError(
        f"{path}: neither a list of samples nor columns; name the key that holds them as `entries:` in the mapping"
    )


def _from_tree(path: Path, tree: Mapping[str, Any], prefix: str = "") -> Table:
    """Flatten nested arrays into columns named ``a.b``, ``a[0]`` and ``a[0].b``, single values into attributes."""
    table = Table(path, {})
    for name, value in tree.items():
        full = prefix + str(name)
        inside: tuple[Mapping[str, Any], str] | None = None
        if isinstance(value, Mapping):
            inside = value, full + "."
        elif (parts := _parts(value)) is not None:
            inside = {f"{name}[{place}]": part for place, part in enumerate(parts)}, prefix
        if inside is not None:
            inner = _from_tree(path, *inside)
            table.columns |= inner.columns
            table.attributes |= inner.attributes
            continue
        if isinstance(value, str):
            table.attributes[full] = value
            continue
        try:
            array = np.asarray(value)
        except ValueError:
            continue
        if array.dtype.kind not in "biufU":
            continue
        array = np.squeeze(array) if array.ndim > 1 else array
        if array.ndim == 0:
            table.attributes[full] = str(array) if array.dtype.kind == "U" else float(array)
        elif array.ndim == 1:
            table.columns[full] = array
        elif array.ndim == 2:
            # The longer axis is that of the samples.
            tall = array if array.shape[0] >= array.shape[1] else array.T
            table.columns |= {f"{full}[{index}]": tall[:, index] for index in range(tall.shape[1])}
    return table


def _parts(value: Any) -> list[Any] | None:
    """Entries of a structure array, or of a cell array of series of several lengths; None for anything else."""
    if isinstance(value, np.ndarray) and (value.dtype.kind != "O" or value.ndim != 1):
        return None
    if not isinstance(value, list | tuple | np.ndarray) or not 0 < len(value) <= _MOST_PARTS:
        return None
    if all(isinstance(part, Mapping) for part in value):
        return list(value)
    several = all(isinstance(part, list | np.ndarray) and not any(map(_has_entries, part)) for part in value)
    return list(value) if several and len({len(part) for part in value}) > 1 else None


def _has_entries(value: Any) -> bool:
    return isinstance(value, list | tuple | Mapping | np.ndarray)
