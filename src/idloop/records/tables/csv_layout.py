"""Where the table of a text file lies: its delimiter, the notes above it, its header and the rows of units."""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from idloop.records.tables.base_units import known_unit

Row: TypeAlias = list[str]

_DELIMITERS = (";", "\t", ",", "|", " ")
# Rows of units, types or descriptions below a header, at most.
_UNIT_ROWS = 3
# Share of the cells of a row of data that are numbers or times, at least.
_NUMBERS = 0.34
_TIME = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d([.,]\d+)?)?(Z|[+-]\d\d:?\d\d)?)?|\d{1,2}:\d\d:\d\d([.,]\d+)?")
# A number with groups of thousands: 1,234.5 and 1.234,5 and 1'234.5.
GROUPED = re.compile(
    r"(?P<head>[-+]?[1-9]\d{0,2})(?P<groups>(?P<sign>[,.'\s])\d{3}(?:(?P=sign)\d{3})*)(?P<part>(?!(?P=sign))[.,]\d+)?"
)
DECIMAL_COMMA = re.compile(r"\s*[+-]?(\d*),(\d+)(?:[eE][+-]?\d+)?\s*")
# An array of one number, as NumPy prints it.
IN_BRACKETS = re.compile(r"\[+\s*([-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan|inf))\s*\]+")
# A number and its unit: 0.284 V, -3°, 1500 1/min.
WITH_UNIT = re.compile(
    r"(?P<number>[-+]?[.,]?\d[\d.,]*(?:[eE][-+]?\d+)?)(?:\s+|(?=[^\d.,]))(?P<unit>[^\s.,:;|+-][^\s,:;|]{0,9})"
)
# A name in a line whose cells are separated by white space, with the unit behind it.
_NAME = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
# Between names of several words in such a line.
_APART = re.compile(r"\t|\s{2,}")
# How a date or a time of day is written stands for its unit: hh:mm:ss,ms and TT.MM.JJJJ.
_PATTERN = re.compile(r"[hmsdytjna]{1,4}(?:[.:,/\- ]+[hmsfdytjna]{1,4})+", re.IGNORECASE)
_UNIT_CELL = re.compile(r"\[.*\]|\(.*\)|<.*>|-|[%°µΩa-zA-Z²³·/*^.0-9]{1,8}")
_ABOVE = 3  # rows in which the name of a column is looked for that the header does not name


@dataclass(frozen=True)
class Layout:
    """Where a table lies in the lines of a file."""

    delimiter: str  # between cells; a blank stands for any white space
    skip: int  # lines above the header, or above the rows where there is no header
    names: Row  # header; empty without one
    units: tuple[Row, ...]  # rows between the header and the first row of data
    width: int  # cells of a row of data
    # Names without those of groups of columns, which stand in the last of the lines above; empty without groups
    own_names: Row = field(default_factory=list)

    @property
    def first(self) -> int:
        """Line of the first row of data."""
        return self.skip + bool(self.names) + len(self.units)


def is_number(text: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def joined_groups(grouped: re.Match[str]) -> str:
    """Return a match of `GROUPED` as a plain number with a decimal point."""
    return grouped["head"] + re.sub(r"\D", "", grouped["groups"]) + (grouped["part"] or "").replace(",", ".")


def is_data(row: Row, width: int) -> bool:
    """Whether a row has the width of the table, and numbers or times in a good share of its cells."""
    if len(row) > width and any(cell.strip() for cell in row[width:]):
        return False
    return len(row) >= width and _numbers(row[:width])[0] > 0.0


def split(lines: Sequence[str], delimiter: str) -> list[Row]:
    """Return the cells of each line."""
    if delimiter == " ":
        return [line.split() for line in lines]
    # Line by line: a quote that is never closed takes no other line with it.
    return [next(iter(csv.reader([line], delimiter=delimiter, skipinitialspace=True)), []) for line in lines]


def find_layout(lines: Sequence[str], *, delimiter: str | None = None, header: bool | None = None) -> Layout:
    """Find the table in the first lines of a file, without empty lines and comments.

    The delimiter is the one whose rows hold most numbers, counted in rows of one width; the table begins where two such
    rows follow each other.
    """
    best: tuple[float, str, int, list[Row]] = (-1.0, "", 0, [])
    for candidate in [delimiter] if delimiter else _DELIMITERS:
        rows = split(lines, candidate)
        scored = [(len(row), _numbers(row)[1]) for row in rows]
        widths = Counter(width for width, score in scored if score)
        width = max(widths, key=lambda one: widths[one], default=0)
        score = sum(one for length, one in scored if length == width)
        if (score, width) > (best[0], best[2]):
            best = (score, candidate, width, rows)
    score, chosen, width, rows = best
    if score == 0.0:
        return _of_texts(lines, delimiter)
    data = _data(rows, width)
    first = next(
        (k for k, good in enumerate(data) if good and (k + 1 == len(data) or data[k + 1])),
        data.index(True) if True in data else 0,
    )
    if header is False:
        return Layout(chosen, first, [], (), width)
    above = _header_rows(lines, rows, first, width, chosen)
    if not above:
        # A single row whose first cell alone is a text has numbers as names.
        named = [is_data(row, width) for row in rows[max(first - 2, 0) : first]]
        head = first - 1 if named[-1:] == [True] and sum(named) == 1 else first
        if header is True or _names_columns(rows[head : head + 20]):
            return Layout(chosen, head, rows[head], (), width)
    names, *units = above or [[]]
    head = first - len(above)
    if repeated(names) and not units and are_units(names):
        # Volt, Volt: the columns have units and no names.
        return Layout(chosen, head, [], (names,), width)
    groups = rows[head - 1] if head and not are_units(rows[head - 1]) else []
    if groups and repeated(names) and (found := _in_groups(groups, names)):
        return Layout(chosen, head, found, tuple(units), width, names)
    below = units[0] if units and not are_units(units[0]) else []
    gaps = any(cell.strip() and not name.strip() for cell, name in zip(below, names, strict=False))
    if (gaps or (below and repeated(names))) and (found := _in_groups(names, below)):
        return Layout(chosen, head + 1, found, tuple(units[1:]), width, below)
    return Layout(chosen, head, _completed(names, rows[max(head - _ABOVE, 0) : head], width), tuple(units), width)


def _completed(names: Row, above: Sequence[Row], width: int) -> Row:
    """Header whose cells without a name have that of the next row above which names all of them."""
    empty = [k for k, name in enumerate(names[:width]) if not name.strip()]
    for row in reversed(above) if empty and len(empty) < len(names) else ():
        whole = len(row) >= width and all(map(str.strip, row[:width])) and not any(map(is_number, row))
        if whole and not any(known_unit(row[k]) for k in empty):
            return [row[k].strip() if k in empty else name for k, name in enumerate(names)]
    return names


def repeated(names: Iterable[str]) -> list[str]:
    """Return the names that several columns have."""
    return [name for name, count in Counter(filter(None, map(str.strip, names))).items() if count > 1]


def _in_groups(groups: Row, names: Row) -> Row:
    """Names of columns behind those of groups, each of which begins above a column; empty where some are alike."""
    cells = [cell.strip() for cell in groups]
    if any(map(is_number, filter(None, cells))):
        return []
    group, found = "", []
    for cell, name in itertools.zip_longest(cells, map(str.strip, names), fillvalue=""):
        group = cell or group
        found.append(f"{group} {name}".strip() if name else cell)
    return [] if repeated(found) else found


def _numbers(row: Row) -> tuple[float, float]:
    """Share of the cells that are numbers or times, and their number weighed by it; zeros where they are too few."""
    cells = [cell for cell in map(str.strip, row) if cell]
    count = sum(map(_is_value, cells))
    if 0 < len(cells) > count and all(_is_value(cell) or WITH_UNIT.fullmatch(cell) for cell in cells):
        count = len(cells)
    share = count / len(cells) if cells else 0.0
    return (share, count * share) if share >= _NUMBERS else (0.0, 0.0)


def _is_value(cell: str) -> bool:
    """Whether a cell is a number or a time."""
    if cell.startswith("["):  # [1] is the unit of what has none
        return "." in cell and IN_BRACKETS.fullmatch(cell) is not None
    return is_number(cell) or any(form.fullmatch(cell.strip()) for form in (_TIME, GROUPED))


def _of_texts(lines: Sequence[str], delimiter: str | None) -> Layout:
    """Layout of a table without a number in its first lines: the first line is the header."""
    counts = {one: lines[0].count(one) for one in _DELIMITERS[:-1]}
    chosen = delimiter or max(counts, key=lambda one: counts[one])
    if delimiter is None and not counts[chosen]:
        chosen = " "
    names = split(lines[:1], chosen)[0]
    return Layout(chosen, 0, names, (), len(names))


def _header_rows(lines: Sequence[str], rows: Sequence[Row], first: int, width: int, delimiter: str) -> list[Row]:
    """Return header and rows of units above the first row of data; empty where there is none."""
    used = max((k + 1 for row in rows[first : first + 2] for k, cell in enumerate(row) if cell.strip()), default=width)
    block: list[Row] = []
    for k in range(first - 1, -1, -1):
        row = rows[k]
        if delimiter == " " and len(row) != width:
            apart = _APART.split(lines[k].strip())
            row = apart if len(apart) == width else _NAME.findall(lines[k])
        cells = [cell.strip() for cell in row]
        # What holds for all rows may stand beyond the last of their columns, with its name above.
        beyond = sum(map(bool, cells[width:]))
        once = are_units(cells) and all(map(is_number, filter(None, cells[width:])))
        fits = used <= len(row) and (not beyond or once or (block and beyond == sum(map(bool, block[0][width:]))))
        numbers = sum(map(is_number, cells))
        if not fits or not any(cells):
            break
        # An oscilloscope writes what holds for all rows beside the units, and the numbers of its channels above them.
        channels = len(block) == 1 and are_units(block[0]) and not is_number(cells[0])
        if numbers and not channels and (block or not are_units(cells)):
            break
        block.insert(0, row)
        if numbers and channels:
            break
    # A spreadsheet fills up lines above a table with empty cells; a header names every column, or all but the first.
    whole = (k for k, row in enumerate(block) if all(map(str.strip, row[1:used])) and not are_units(row))
    block = block[next(whole, 0) :]
    if not block:
        return []
    # The lowest row that is none of units; of a file that begins with the header, all rows below are units or types.
    lowest = len(block) - 1
    while lowest > 0 and len(block) - lowest <= _UNIT_ROWS and are_units(block[lowest]):
        lowest -= 1
    if len(block) == first and len(block) <= 1 + _UNIT_ROWS:
        lowest = 0
    return block[lowest:]


def _names_columns(rows: Sequence[Row]) -> bool:
    """Whether the first row has a text in a column that otherwise holds numbers."""
    head, *below = rows
    texts = [k for k, cell in enumerate(head) if cell.strip() and not is_number(cell)]
    return bool(below) and any(all(k < len(row) and is_number(row[k]) for row in below) for k in texts)


def _data(rows: Sequence[Row], width: int) -> list[bool]:
    """Which rows are of data; a text where others begin with a number is the name of what stands beside it."""
    found = [is_data(row, width) for row in rows]
    named = [bool(row) and bool(row[0].strip()) and not _is_value(row[0]) for row in rows]
    begin = [one for one, good in zip(named, found, strict=True) if good]
    if 2 * sum(begin) >= len(begin):
        return found
    return [good and not one for good, one in zip(found, named, strict=True)]


def are_units(row: Row) -> bool:
    """Whether a row holds units, types or what stands for them."""
    cells = [cell.strip() for cell in row if cell.strip() and not is_number(cell)]
    cells = [cell for cell in cells if not _PATTERN.fullmatch(cell)]
    units = [_UNIT_CELL.fullmatch(cell) for cell in cells]
    # TIME,CH1,CH2 is no row of units: one of them is known, or all are in brackets.
    return all(units) and any(known_unit(cell) or cell[0] in "[(<-" for cell in cells)
