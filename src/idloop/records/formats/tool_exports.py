"""Text files of four tools: LabVIEW, older oscilloscopes of Tektronix, TwinCAT Scope and CODESYS."""

from __future__ import annotations

import csv
import re
from array import array
from itertools import islice
from pathlib import Path

import numpy as np

from idloop.documents import MOST_COLUMNS
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, check_size, lines_of, read_text_table, text_of
from idloop.records.tables.csv_file import COMMENTS
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.reshaping import cut_at_ends
from idloop.records.tables.table import Table

_LABVIEW, _END_OF_HEAD = "LabVIEW Measurement", "***End_of_Header***"
_MOST_HEAD = 1_000  # lines of the heads of a LabVIEW file
_KEY = re.compile(r"(\w+)[\t,]\s*(\S*)")
_X_IS_TIME = re.compile(r"^X_Dimension\W+Time\b", re.MULTILINE)
# Of Tektronix: columns of keys, values and units beside the first rows, and the rows among which they stand.
_BESIDE, _ROWS_BESIDE = 3, 40
_DELIMITERS = (";", "\t", ",")
_MOST_ABOVE = 100  # lines above the rows of TwinCAT
_NAME, _PERIOD = "name", "sampletime[ms]"
_VARIABLE = re.compile(r"(\d+)\.Variable\s*;\s*(.*?)\s*")
_CODESYS = re.compile(r"\[key\]\s*;\s*\[value\]", re.IGNORECASE)
_WORDS = {"TRUE": "1", "FALSE": "0"}


def _read_labview(path: Path, options: Options) -> Table:
    """Read a file with one segment.

    Source: National Instruments, *Specification for the LabVIEW Measurement File (.lvm)*.
    """
    check_size(path, "keep fewer rows")
    above: list[str] = []
    ends: list[int] = []
    for line in lines_of(path):
        if _is_counted(line):
            above.append(line.strip("\r\n"))
        if line.startswith(_END_OF_HEAD):
            ends.append(len(above))
        if len(above) > _MOST_HEAD:
            break
    if not ends:
        raise InputError(
            f"{path}: no {_END_OF_HEAD} in its first {_MOST_HEAD:,} lines; check that this is a LabVIEW file"
        )
    if len(above) == ends[-1]:
        raise InputError(f"{path}: there is no table below its head; check that the recording was saved whole")
    if len(ends) > 2:
        raise InputError(f"{path}: it holds {len(ends) - 1} segments; save each in a file of its own")
    head = above[: ends[-1]]
    said = {match[1]: match[2] for line in head if (match := _KEY.match(line))}
    delimiter = "," if said.get("Separator", "").lower() == "comma" else "\t"
    decimal = "," if said.get("Decimal_Separator") == "," else "."
    table = _rows_below(path, options, ends[-1] + 1, delimiter, decimal)
    # The rows have no cell for the last name, Comment, where there is none.
    names = _cells(above[ends[-1]], delimiter)
    if len(table.columns) <= len(names) == len(set(names)):
        table.columns = dict(zip(names, table.columns.values(), strict=False))
    clock = "X_Value"
    if clock in table.columns and _X_IS_TIME.search("\n".join(head)):
        channels = [name for name in table.columns if name not in (clock, "Comment")]
        units = next((row[1:] for row in (_cells(one, delimiter) for one in head) if row[0] == "Y_Unit_Label"), [])
        table.units |= {clock: "s"} | {name: unit for name, unit in zip(channels, units, strict=False) if unit}
        table.clocks = dict.fromkeys(channels, clock)
    return table


def _is_counted(line: str) -> bool:
    """Whether the reader of tables counts a line."""
    return bool(line.strip()) and not line.lstrip().startswith(COMMENTS)


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in line.rstrip("\r\n").split(delimiter)]


def _rows_below(path: Path, options: Options, skip: int, delimiter: str, decimal: str = ".") -> Table:
    own = {"skip_rows": skip, "header": False, "delimiter": delimiter, "decimal": decimal}
    return read_text_table(path, {**options, **own})


def _read_tektronix(path: Path, options: Options) -> Table:
    """Read a channel of a TDS 1000, 2000 or 3000, such as ``F0000CH1.CSV``.

    Each of the first rows is key, value, unit, stamp, reading; in the rows below the first three are empty.
    """
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            beside = csv.reader(islice(stream, _ROWS_BESIDE), skipinitialspace=True)
            rows = [list(map(str.strip, row)) for row in beside]
    except csv.Error as error:
        raise InputError(f"{path}: its settings cannot be read ({error}); save the waveform again") from None
    keys = {row[0].lower(): row[1] for row in rows if len(row) > 1 and row[0]}
    table = _rows_below(path, options, 0, ",")
    stamps, *readings = list(table.columns.values())[_BESIDE:] or [None]
    if stamps is None or not readings:
        raise InputError(f"{path}: no stamps and readings stand beside the keys; save the waveform again")
    names = [keys.get("source", "CH1")] if len(readings) == 1 else [f"CH{k}" for k in range(1, len(readings) + 1)]
    table.columns = {"time": stamps, **dict(zip(names, readings, strict=True))}
    table.units = {"time": keys.get("horizontal units", "s")} | dict.fromkeys(names, keys.get("vertical units", ""))
    table.attributes = {key: float(value) for key, value in keys.items() if is_number(value)}
    return table


def _is_tektronix(head: bytes) -> bool:
    row = next(csv.reader(text_of(head).splitlines()[:1], skipinitialspace=True), [""])
    behind = [cell for cell in map(str.strip, row[_BESIDE:]) if cell]
    return "".join(row[:1]).strip().lower() == "record length" and len(behind) > 1 and all(map(is_number, behind))


def _read_twincat(path: Path, options: Options) -> Table:
    """Read pairs of columns, the stamps and the values of each channel, below pairs of keys."""
    check_size(path, "export fewer rows")
    head: list[str] = []
    for line in filter(_is_counted, lines_of(path)):
        cells = next((several for one in _DELIMITERS if len(several := _cells(line, one)) > 1), [])
        is_row = bool(cells) and all(map(is_number, filter(None, cells)))
        if is_row or len(head) > _MOST_ABOVE:
            break
        head.append(line)
    delimiter, keys = _twincat_keys(head)
    if not keys:
        raise InputError(f"{path}: no pairs of Name and SampleTime[ms] above the rows; check that this is the export")
    table = _rows_below(path, options, len(head), delimiter)
    names, columns = keys[_NAME], list(table.columns.values())
    if len(columns) != 2 * len(names) or len(set(names)) < len(names):
        raise InputError(
            f"{path}: {len(names)} channels by name and {len(columns)} columns, not a pair for each; export it again"
        )
    table.columns = {}
    for name, stamps, values in zip(names, columns[::2], columns[1::2], strict=True):
        table.add_series(name, stamps, values, "ms")
    cut_at_ends(table.columns, table.clocks)
    table.units |= {name: unit for name, unit in zip(names, keys.get("unit", []), strict=False) if unit}
    return table


def _twincat_keys(head: list[str]) -> tuple[str, dict[str, list[str]]]:
    """Delimiter, and what stands beside a key for each channel; nothing where names or periods are missing."""
    for delimiter in _DELIMITERS:
        found: dict[str, list[str]] = {}
        for cells in (_cells(line, delimiter) for line in head):
            if len(cells) > 1 and len({cell.lower() for cell in cells[:-1:2]}) == 1:
                # The name of the project stands above those of the channels.
                found[cells[0].lower()] = cells[1::2]
        if found.keys() >= {_NAME, _PERIOD} and len(found[_NAME]) == len(found[_PERIOD]):
            return delimiter, found
    return "", {}


def _is_twincat(head: bytes) -> bool:
    text = text_of(head)
    return _PERIOD in text[:20_000].lower() and bool(_twincat_keys(text.splitlines()[:_MOST_ABOVE])[1])


def _read_codesys(path: Path, _: Options) -> Table:
    """Read the blocks of stamps and values below the head of a trace, one for each variable."""
    check_size(path, "trace fewer variables")
    variables: dict[str, tuple[array[float], array[float]]] = {}
    name = ""
    for number, line in enumerate(lines_of(path), 1):
        if line.startswith(";"):
            cells = _cells(line, ";")
            if not name or (len(cells) < 3 and not any(cells)):
                continue
            try:
                stamp, value = float(cells[1]), float(_WORDS.get(cells[2], cells[2]).replace(",", "."))
            except (ValueError, IndexError):
                raise InputError(
                    f"{path}: line {number} of {name!r} is {line.strip()[:40]!r}, not a stamp and a value; correct the"
                    " file"
                ) from None
            stamps, values = variables.setdefault(name, (array("d"), array("d")))
            stamps.append(stamp)
            values.append(value)
        elif match := _VARIABLE.fullmatch(line.strip()):
            name = match[2] or match[1]
            name = f"{name} ({match[1]})" if name in variables else name
            if 2 * len(variables) > MOST_COLUMNS:
                raise InputError(f"{path}: more than {MOST_COLUMNS:,} columns; check that this is the data file")
    if not variables:
        raise InputError(f"{path}: a trace of CODESYS without values; check that it was saved after it had run")
    table = Table(path, {})
    for name, (stamps, values) in variables.items():
        table.add_series(name, np.array(stamps), np.array(values), "ms")
    table.notes.append("the stamps of a trace are taken as ms; of one with µs set `time:` of each signal")
    return table


def _is_codesys(head: bytes) -> bool:
    first, *others = text_of(head).lstrip().splitlines() or [""]
    return _CODESYS.match(first) is not None and any(_VARIABLE.fullmatch(line.strip()) for line in others)


LABVIEW = Form(
    "lvm",
    (".lvm",),
    "LabVIEW measurement file",
    "by the header; `X_Value` holds the stamps [s] of the others",
    lambda head: text_of(head).startswith(_LABVIEW),
    _read_labview,
)
TEKTRONIX = Form(
    "tektronix",
    (),
    "waveform of an older oscilloscope of Tektronix, its settings beside the first rows",
    "`time`, and the channel by its name: `CH1`",
    _is_tektronix,
    _read_tektronix,
)
TWINCAT = Form(
    "twincat",
    (),
    "export of TwinCAT Scope as text",
    "by `Name`; each with its own stamps in `Name.time` [ms]",
    _is_twincat,
    _read_twincat,
)
CODESYS = Form(
    "codesys",
    (".trace.csv",),
    "trace of CODESYS, saved as text",
    "variables by name, each with its own stamps in `name.time` [ms]",
    _is_codesys,
    _read_codesys,
)
