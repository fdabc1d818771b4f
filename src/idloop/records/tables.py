"""CSV, MAT, NPZ and JSON files as named columns."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
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
        What had to be found out about how the file is written.
    """

    path: Path
    columns: dict[str, Any]
    attributes: dict[str, float | str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

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

    def numbers(self, name: str | int) -> NDArray[np.float64]:
        """Return a column as floats (n,); an empty cell is NaN.

        Raises
        ------
        InputError
            Unknown column, or a cell that is no number.
        """
        raw = self.raw(name)
        try:
            return np.asarray(raw, dtype=np.float64).ravel()
        except (TypeError, ValueError):
            return np.array([self._number(cell, name, row) for row, cell in enumerate(raw)])

    def _number(self, cell: Any, name: str | int, row: int) -> float:
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            return float("nan")
        try:
            return float(cell)
        except (TypeError, ValueError):
            cure = ', say `csv: {decimal: ","}` if it has a decimal comma' if "," in str(cell) else ""
            raise InputError(
                f"{self.path}: row {row} of column {name!r} is {str(cell)[:40]!r}, not a number;"
                f" mend the file{cure} or choose another column"
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
        ``delimiter``, ``header``, ``skip_rows``, ``decimal`` (csv); ``entries`` (json: key of the list of samples).

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
            f"{path}: unknown format {path.suffix!r}; known are {listed(FORMATS)}, or say `format:` in the mapping"
        )
    table = readers[kind](path, options)
    if not table.columns:
        raise InputError(f"{path}: no columns of numbers found; check that this is the data file")
    if not any(len(column) for column in table.columns.values()):
        raise InputError(
            f"{path}: there are no rows of data, only the names of columns ({listed(table.columns)});"
            " check that the recording was saved whole"
        )
    return table


def _read_csv(path: Path, options: dict[str, Any]) -> Table:
    text, notes = _decoded(path)
    lines: list[str] = []
    said = ""
    for line in io.StringIO(text, newline=""):
        if line.lstrip().startswith(_COMMENT):
            said = said if lines else line
        elif line.strip():
            lines.append(line)
    lines = lines[int(options.get("skip_rows") or 0) :]
    if not lines:
        raise InputError(f"{path}: the file holds no rows; check that this is the data file")
    commas = options.get("decimal") == ","
    delimiter = options.get("delimiter") or _delimiter(lines[:_LOOKED_AT], commas=commas)
    if delimiter == " ":
        rows = [line.split() for line in lines]
    else:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    header = options.get("header")
    if header is None:
        header = not all(_is_number(cell) for cell in rows[0] if cell.strip())
        if not header and (names := _names_in_comment(said, delimiter, len(rows[0]))):
            rows, header = [names, *rows], True
    width = len(rows[0])
    while width > 1 and not any(row[width - 1 :] and row[width - 1].strip() for row in rows):
        width -= 1  # a delimiter at the end of every line makes a column of nothing
    names = (
        [cell.strip() or str(index) for index, cell in enumerate(rows[0][:width])]
        if header
        else [str(k) for k in range(width)]
    )
    body = rows[1:] if header else rows
    if header:
        body, units = _without_units(body)
        notes += [f"the row below the header is taken for units and left out: {listed(units, 12)}"] if units else []
    _check_widths(path, body, width, delimiter)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path}: column {twice!r} occurs twice; rename one in the header")
    columns: dict[str, Any] = {name: [row[index] for row in body] for index, name in enumerate(names)}
    if commas:
        columns = {name: [cell.replace(",", ".") for cell in column] for name, column in columns.items()}
    elif (delimiter != "," or '"' in text) and "," in text and _has_decimal_commas(path, columns):
        columns = {name: [_with_point(cell) for cell in column] for name, column in columns.items()}
        notes.append("its numbers are read with decimal commas")
    return Table(path, columns, notes=notes)


# What a line that is no data begins with.
_COMMENT = ("#", "%")
# Lines from which the delimiter is told.
_LOOKED_AT = 20
# Rows of units, types or descriptions below a header, at most.
_UNIT_ROWS = 3
_COMMA = re.compile(r"\s*[+-]?(\d*),(\d+)(?:[eE][+-]?\d+)?\s*")


def _decoded(path: Path) -> tuple[str, list[str]]:
    """Text of a file, and what had to be found out about how it is written."""
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        with contextlib.suppress(UnicodeDecodeError):
            text = content.decode("utf-16")
            if "\n" in text or "\r" in text:
                return text, []
    try:
        return content.decode("utf-8-sig"), []
    except UnicodeDecodeError as error:
        # Letters such as ° and µ of a program that writes as Windows does; nothing of it looks like that by chance.
        if any(byte < 0x20 and byte not in b"\t\n\v\f\r\x1a" for byte in content):
            raise InputError(
                f"{path}: not a text file ({error.reason} at byte {error.start}); check that this is the data file, "
                "or save it as CSV in UTF-8"
            ) from None
    try:
        return content.decode("cp1252"), ["it is not in UTF-8 and read as Windows-1252"]
    except UnicodeDecodeError:
        return content.decode("latin-1"), ["it is not in UTF-8 and read as Latin-1"]


def _delimiter(lines: Sequence[str], *, commas: bool) -> str:
    """What stands between the cells.

    Of what every line has as often, that which leaves most numbers in a line of data: decimal commas, and blanks beside
    a delimiter, may be as many.
    """
    candidates = (";", "\t") if commas else (";", "\t", ",")
    even = []
    for candidate in candidates:
        first, *others = (line.count(candidate) for line in lines)
        if first and all(count == first for count in others):
            even.append(candidate)
    if even:
        return max(even, key=lambda candidate: sum(map(_is_number, lines[-1].split(candidate))))
    counts = {candidate: lines[0].count(candidate) for candidate in candidates}
    best = max(counts, key=lambda candidate: counts[candidate])
    return best if counts[best] else " "


def _names_in_comment(line: str, delimiter: str, width: int) -> list[str]:
    """Names of the columns in the comment above the first row, as numpy.savetxt writes them; empty without any."""
    text = line.strip().lstrip("".join(_COMMENT)).strip()
    cells = text.split() if delimiter == " " else [cell.strip() for cell in text.split(delimiter)]
    return cells if len(cells) == width > 1 and not any(map(_is_number, cells)) else []


def _without_units(body: list[list[str]]) -> tuple[list[list[str]], list[str]]:
    """Rows of data, and the cells of a row of units above them: no number stands there where the next row has some."""
    for count in range(1, min(_UNIT_ROWS, len(body) - 1) + 1):
        above, below = body[count - 1], body[count]
        told = [cell.strip() for cell in above if cell.strip()]
        if not told or any(_is_number(cell) for cell in told):
            break
        if any(_is_number(cell) for cell in below if cell.strip()):
            return body[count:], [cell.strip() for row in body[:count] for cell in row if cell.strip()]
    return body, []


def _check_widths(path: Path, body: list[list[str]], width: int, delimiter: str) -> None:
    for number, row in enumerate(body):
        if len(row) < width:
            raise InputError(
                f"{path}: row {number} has {len(row)} cells instead of {width}; the file is damaged or cut off there"
            )
        if any(cell.strip() for cell in row[width:]):
            cure = (
                "save it with ; between the columns if its numbers have decimal commas"
                if delimiter == ","
                else "say `csv: {delimiter: ...}` in the mapping, or mend the row"
            )
            raise InputError(f"{path}: row {number} has {len(row)} cells instead of {width}; {cure}")


def _has_decimal_commas(path: Path, columns: Mapping[str, Sequence[str]]) -> bool:
    """Whether numbers are written as 0,5; refused where they could be thousands as well."""
    found, sure = "", False
    for column in columns.values():
        for cell in column:
            match = _COMMA.fullmatch(cell)
            if match is None:
                if "," not in cell and "." in cell and _is_number(cell):
                    return False  # a point is the decimal sign here
                continue
            found = found or cell.strip()
            # 1,234 may be a thousand; 0,234 and 1,23 are none.
            sure = sure or len(match[2]) != 3 or match[1].lstrip("0") == "" or len(match[1]) > 3
    if found and not sure:
        raise InputError(
            f'{path}: {found!r} may be a decimal number or a thousand; say `csv: {{decimal: ","}}` in the mapping, or '
            "save the file without separators of thousands"
        )
    return sure


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _read_mat(path: Path, _: dict[str, Any]) -> Table:
    from scipy.io import loadmat

    from idloop.records.mat_structure import mat_damage

    try:
        damage = mat_damage(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
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
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            return _from_tree(path, {name: content[name] for name in content.files})
    except (OSError, ValueError, EOFError) as error:
        raise InputError(
            f"{path}: not a readable NPZ file ({' '.join(str(error).split())}); check the copy of the file"
        ) from None
    except Exception as error:  # noqa: BLE001 - zipfile's own errors for a cut archive
        raise InputError(
            f"{path}: not a readable NPZ file ({type(error).__name__}); check the copy of the file"
        ) from None


def _read_json(path: Path, options: dict[str, Any]) -> Table:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid JSON ({error}); check the copy of the file") from None
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
        f"{path}: neither a list of samples nor columns; say under which key they are: `entries:` in the mapping"
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
            # Samples run along the longer side.
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
