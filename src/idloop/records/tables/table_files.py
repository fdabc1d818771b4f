"""Files of any form that is known, as named columns; texts that are numbers but for how they are written are read."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.registry import form_of
from idloop.records.tables.csv_layout import DECIMAL_COMMA, GROUPED, IN_BRACKETS, is_number, joined_groups
from idloop.records.tables.reshaping import join_stamps, spread_names, take_header_stamps, turn_rows
from idloop.records.tables.table import Table
from idloop.spelling import counted, did_you_mean, is_or_are, listed

__all__ = ["Table", "read_table"]
_ISO = re.compile(r"\d{4}-\d\d-\d\d")
_CLOCK = re.compile(
    r"(?:\d{1,4}[./-]\d{1,2}[./-]\d{2,4}[ T]+)?"
    r"(?:(?P<hour>[01]?\d|2[0-3]):)?(?P<minute>[0-5]?\d):(?P<second>[0-5]\d)(?P<part>[.,]\d+|[:;]\d{3}(?!\d))?"
    r"\s*(?P<half>[AaPp])?\.?[Mm]?\.?"
)
_DAY, _HOUR = 86_400.0, 3_600.0
# Cells that tell what kind of column it is.
_FIRST = 200


def read_table(path: Path, kind: str | None = None, options: Mapping[str, Any] | None = None) -> Table:
    """Read a file into columns.

    `path`: the file.
    `kind`: form, one of `idloop.records.formats.registry.kinds`; by default found out from its first bytes and its
    suffix.
    `options`: ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``, ``rows`` (csv: slice of the rows of
    data that are looked at); ``entries`` (json, torch: key of the list of samples).
    Raises InputError: missing or unreadable file, unknown form, no rows.
    """
    if path.exists() and not path.is_file():
        what = "a directory" if path.is_dir() else "no regular file"
        raise InputError(f"{path}: {what}; name the file that holds the data")
    if not path.is_file():
        near = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        raise InputError(f"{path}: no such file{did_you_mean(path.name, near) or '; check the path'}")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty (0 bytes); check that the recording was saved")
    try:
        table = form_of(path, kind).read(path, dict(options or {}))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    read_texts(table)
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
    if table.text is not None:
        turn_rows(table)
    spread_names(table)
    join_stamps(table)
    take_header_stamps(table)
    return table


def read_texts(table: Table) -> None:
    """Replace columns of text by the numbers that they mean, and note how.

    A time of day becomes seconds since midnight, on and on over midnight. Groups of thousands are joined where it is
    certain which sign is the decimal one. An array of one number, as NumPy prints it, is that number. Single cells of
    text among numbers were not measured: NaN.
    """
    texts = {
        name: column
        for name, column in table.columns.items()
        if not isinstance(column, np.ndarray) and any(isinstance(cell, str) for cell in column)
    }
    points = bool(texts) and any(map(_has_fractions, table.columns.values()))
    for name, column in texts.items():
        cells = _without_brackets(table, name, [cell.strip() if isinstance(cell, str) else cell for cell in column])
        if (clock := _clock(cells)) is not None:
            table.columns[name] = clock
            table.units[name] = "s"
            table.notes.append(f"column {name!r} is a time of day and read as seconds")
        elif (numbers := _numbers(table, name, _joined_groups(table, name, cells, points=points))) is not None:
            table.columns[name] = numbers


def _has_fractions(column: Any) -> bool:
    if not isinstance(column, np.ndarray) or column.dtype.kind != "f":
        return False
    known = column[np.isfinite(column)]
    return bool((known != np.floor(known)).any())


def _clock(cells: list[Any]) -> Array | None:
    """Times of day [s]; None where a cell is none, or a date of ISO 8601 stands before it."""
    seconds = []
    hours = False
    for cell in cells:
        match = _CLOCK.fullmatch(cell) if isinstance(cell, str) and not _ISO.match(cell) else None
        # Two numbers alone may be hours and minutes.
        if match is None or not (match["hour"] or (match["part"] and not match["half"])):
            return None
        hours = hours or match["hour"] is not None
        hour = int(match["hour"] or 0)
        if match["half"]:
            hour = hour % 12 + 12 * (match["half"] in "Pp")
        part = float(f"0.{match['part'][1:]}") if match["part"] else 0.0
        seconds.append(_HOUR * hour + 60.0 * int(match["minute"]) + int(match["second"]) + part)
    if not seconds:
        return None
    found, whole = np.array(seconds), _DAY if hours else _HOUR
    # It begins anew at midnight; of minutes and seconds alone, at every hour.
    return found + whole * np.concatenate([[0.0], np.cumsum(np.diff(found) < -0.5 * whole)])


def _without_brackets(table: Table, name: str, cells: list[Any]) -> list[Any]:
    """Take single numbers out of the brackets of an array, and note it: ``[-1.2e-15]``."""
    inside = {
        k: match[1] for k, cell in enumerate(cells) if isinstance(cell, str) and (match := IN_BRACKETS.fullmatch(cell))
    }
    if inside:
        table.notes.append(f"column {name!r}: single numbers in brackets are read as numbers")
    return [inside.get(k, cell) for k, cell in enumerate(cells)] if inside else cells


def _joined_groups(table: Table, name: str, cells: list[Any], *, points: bool) -> list[Any]:
    """Join groups of thousands where it is certain that they are: `points` are the decimal sign of other columns."""
    found = ((place, GROUPED.fullmatch(cell)) for place, cell in enumerate(cells) if isinstance(cell, str))
    if 2 * sum(_is_value(cell) or GROUPED.fullmatch(cell) is not None for cell in cells[:_FIRST]) <= len(
        cells[:_FIRST]
    ):
        return cells
    grouped = {place: match for place, match in found if match is not None}
    if len({match["sign"] for match in grouped.values()}) != 1:
        return cells
    sign = next(iter(grouped.values()))["sign"]
    certain = sum(bool(match["part"]) or match["groups"].count(sign) > 1 for match in grouped.values())
    points = points or any(isinstance(cell, str) and "." in cell and "," not in cell for cell in cells)
    # 1.234 is a plain number unless most others are written as 1.234,5; 1,234 is none where points are decimal.
    if not (sign not in ".," or 2 * certain > len(grouped) or (sign == "," and (certain or points))):
        return cells
    table.notes.append(f"column {name!r}: its groups of thousands are joined")
    joined = list(cells)
    for place, match in grouped.items():
        joined[place] = joined_groups(match)
    return joined


def _numbers(table: Table, name: str, cells: list[Any]) -> Array | None:
    """Return a column as numbers where most cells are, and note the others; None where they are not."""
    if sum(_is_value(cell) for cell in cells[:_FIRST]) * 2 <= len(cells[:_FIRST]):
        return None
    others = [row for row, cell in enumerate(cells) if not _is_value(cell)]
    # What may be a number in another way of writing is not left out.
    otherwise = (cells[row] for row in others)
    words = (isinstance(one, str) and not (GROUPED.fullmatch(one) or DECIMAL_COMMA.fullmatch(one)) for one in otherwise)
    if 2 * len(others) >= len(cells) or not all(words):
        return None
    if others:
        said = listed([repr(word[:20]) for word, _ in Counter(cells[row] for row in others).most_common()], 3)
        table.notes.append(
            f"column {name!r}: {counted(len(others), 'cell')} of text ({said}), the first in row"
            f" {table.first_row + others[0]}, {is_or_are(len(others))} read as not measured"
        )
    left_out = set(others)
    return np.array([
        np.nan if row in left_out or cell is None or cell == "" else float(cell) for row, cell in enumerate(cells)
    ])  # fmt: skip


def _is_value(cell: Any) -> bool:
    """Whether a cell is a number, or nothing."""
    if isinstance(cell, str):
        return not cell or (is_number(cell) and "," not in cell)
    return cell is None or isinstance(cell, int | float)
