"""Exports of TwinCAT Scope: pairs of columns, the stamps and the values of each channel, below pairs of keys."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.text_table import read_text_table
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.paired_columns import cut_at_ends
from idloop.records.tables.table import Table

_DELIMITERS = (";", "\t", ",")
_NAME, _PERIOD, _UNIT = "name", "sampletime[ms]", "unit"
_MOST_LINES = 100  # above the rows


def read_twincat(path: Path, options: Options) -> Table:
    """Read the channels of an export, each with its own stamps.

    Raises InputError: it has no such head, no rows, or a channel twice.
    """
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; export fewer rows")
    head: list[str] = []
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        for line in stream:
            if not line.strip() or line.lstrip().startswith(("#", "%")):
                continue  # the reader of tables does not count them
            if _is_row(line) or len(head) > _MOST_LINES:
                break
            head.append(line)
    delimiter, keys = _keys(head)
    if not keys:
        raise InputError(f"{path}: no pairs of Name and SampleTime[ms] above the rows; check that this is the export")
    own = {"skip_rows": len(head), "header": False, "delimiter": delimiter}
    table = read_text_table(path, {**options, **own})
    names, columns = keys[_NAME], list(table.columns.values())
    if len(columns) != 2 * len(names) or len(set(names)) < len(names):
        raise InputError(
            f"{path}: {len(names)} channels by name and {len(columns)} columns, not a pair for each; export it again"
        )
    table.columns = {}
    for name, stamps, values in zip(names, columns[::2], columns[1::2], strict=True):
        clock = f"{name}.time"
        table.columns |= {name: values, clock: stamps}
        table.clocks[name], table.units[clock] = clock, "ms"
    cut_at_ends(table.columns, table.clocks)
    table.units |= {name: unit for name, unit in zip(names, keys.get(_UNIT, []), strict=False) if unit}
    return table


def _is_row(line: str) -> bool:
    """Whether a line holds numbers only."""
    for delimiter in _DELIMITERS:
        cells = [cell.strip() for cell in line.split(delimiter)]
        if len(cells) > 1:
            return all(is_number(cell) for cell in cells if cell)
    return False


def _keys(lines: Iterable[str]) -> tuple[str, dict[str, list[str]]]:
    """Delimiter, and what stands beside a key for each channel; nothing where names or periods are missing."""
    head = list(lines)
    for delimiter in _DELIMITERS:
        found: dict[str, list[str]] = {}
        for line in head:
            cells = [cell.strip() for cell in line.rstrip("\r\n").split(delimiter)]
            if len(cells) > 1 and len({cell.lower() for cell in cells[:-1:2]}) == 1:
                # The name of the project stands above those of the channels.
                found[cells[0].lower()] = cells[1::2]
        if found.keys() >= {_NAME, _PERIOD} and len(found[_NAME]) == len(found[_PERIOD]):
            return delimiter, found
    return "", {}


def _is_twincat(head: bytes) -> bool:
    text = text_of(head)
    return _PERIOD in text[:20_000].lower() and bool(_keys(text.splitlines()[:_MOST_LINES])[1])


FORM = Form(
    "twincat",
    (),
    "export of TwinCAT Scope as text",
    "by `Name`; each with its own stamps in `Name.time` [ms]",
    _is_twincat,
    read_twincat,
)
