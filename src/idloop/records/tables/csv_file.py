"""Columns of a CSV file, read line by line, so that a number takes eight bytes however it was written."""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.tables.base_units import SECONDS, clock_unit, known_unit
from idloop.records.tables.csv_layout import (
    DECIMAL_COMMA,
    GROUPED,
    WITH_UNIT,
    Layout,
    Row,
    are_units,
    find_layout,
    is_data,
    is_number,
    joined_groups,
    repeated,
)
from idloop.records.tables.reshaping import are_alike, clocks_of, cut_at_ends, numbered
from idloop.records.tables.table import Table, TextLines
from idloop.spelling import counted, is_or_are, listed

# Consecutive cells of one column: numbers, or texts where one of them is no number.
Part: TypeAlias = NDArray[np.float64] | list[str]

COMMENTS = ("#", "%")  # first characters of lines without data
_FIRST_LINES = 400  # among which the table is looked for
# A delimiter that Excel writes into the first line.
_SEP = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)
_TERMINATOR = ";"
_LINE_OF_MATRIX = re.compile(r"\s*(?:[\[(]+([^\[\]()]*)|([^\[\]()]*?)[\])]+\s*[;,]?\s*)")
_LIST = re.compile(r"\s*[\[(]([^\[\]()]*[^\s\[\]()][^\[\]()]*)[\])]\s*")
_UNITS = re.compile(r"\bunits?\b", re.IGNORECASE)
# Cells that are converted at once, bytes of a file that are decoded at once, and bytes of a cell as a text.
_CELLS, _BLOCK, _TEXT_CELL = 500_000, 1 << 24, 64
_LINES_OF_CELL = 3  # that a cell in quotes goes over at most
# What notes say of lines that were left out: texts, and rows that were cut off or run together.
_BETWEEN, _CUT, _ENDS = "of text between the rows", "of another number of cells", "the file ends within it"
SKIPPED = (_BETWEEN, _CUT, _ENDS)


def read_csv(path: Path, options: dict[str, Any], rows: slice = slice(0, None)) -> Table:
    """Read the columns of a file: numbers where every cell is one or empty (NaN), texts otherwise.

    `options`: ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``.
    `rows`: rows of data to read; the others are not looked at.
    Raises InputError: the file is no such table, or takes more than `MOST_TABLE`.
    """
    encoding, notes = _encoding(path)
    table = Table(path, {}, notes=notes, first_row=rows.start or 0, text=TextLines())
    with path.open(encoding=encoding, newline="") as stream:
        try:
            _read(stream, options, table, rows)
        except csv.Error as error:
            raise InputError(f"{path}: cannot be read as a table ({error}); check that this is the data file") from None
    return table


def _read(stream: TextIO, options: dict[str, Any], found: Table, selected: slice) -> None:
    path, text = found.path, found.text or TextLines()
    layout, lines = _table_in(path, stream, options, text)
    names, units = layout.names, layout.units
    if not names and options.get("header") is None:
        names, above_rows = _header_in_comment(text.comments, layout.delimiter, layout.width)
        units = (*above_rows, *units)
    if any(cell.strip() for row in layout.units for cell in row[layout.width :]):
        names = names[: layout.width]
    commas = options.get("decimal") == ","
    table = _Columns(path, max(layout.width, len(names)), selected.start or 0, commas=commas)
    table.read(_rows(lines, layout, text if options.get("skip_text") else None), selected)
    # A delimiter at the end of every line makes a column of nothing.
    used = max((index + 1 for index, cell in enumerate(names) if cell.strip()), default=0)
    width = max(1, min(len(table.columns), max(used, table.used_width)))
    table.check_lengths(width, layout.delimiter)
    nameless = not names
    names = [cell.strip() or str(index) for index, cell in enumerate(names)] or list(map(str, range(width)))
    names = names[:width]
    own_names = layout.own_names or names
    clocks = clocks_of(own_names[:width])
    if clocks:
        names = numbered(names)
    kept = _without_copies(names, table.columns) if not clocks else list(range(width))
    if len(kept) < len(names):
        copies = dict.fromkeys(names[place] for place in range(width) if place not in kept)
        found.notes.append(f"columns of one name and the same stamps ({listed(copies, 3)}) are read once")
        names, own_names = [names[k] for k in kept], [own_names[k] for k in kept]
        units = tuple([row[k] for k in kept if k < len(row)] for row in units)
    names = _told_apart(found, names, layout.delimiter)
    columns = [table.columns[place] for place in kept]
    in_cells = {name: _take_units(path, name, parts, table.start) for name, parts in zip(names, columns, strict=True)}
    if not commas and not table.has_points and _has_decimal_commas(path, columns):
        columns = [[_with_points(part) if isinstance(part, list) else part for part in parts] for parts in columns]
        found.notes.append("its numbers are read with decimal commas")
    columns = [[_numbers_or_texts(part) if isinstance(part, list) else part for part in parts] for parts in columns]
    found.columns = {name: _joined(parts) for name, parts in zip(names, columns, strict=True)}
    if nameless:
        found.columns = _named_in_rows(found.columns)
    _note_layout(found, text, replace(layout, units=units), [*names, *layout.names[len(names) :]])
    if taken := {name: unit for name, unit in in_cells.items() if unit}:
        found.units |= taken
        said = listed([f"{name} in {unit}" for name, unit in taken.items()], 12)
        found.notes.append(f"units are read from the cells: {said}")
    for clock in set(clocks.values()):
        found.units.setdefault(names[clock], clock_unit(own_names[clock]) or "")
    own = {names[place]: names[clock] for place, clock in clocks.items()}
    if own and not are_alike([found.columns[clock] for clock in dict.fromkeys(own.values())]):
        found.clocks = own
        cut_at_ends(found.columns, own)


def _table_in(path: Path, stream: TextIO, options: dict[str, Any], text: TextLines) -> tuple[Layout, Iterator[str]]:
    """Find where the table of a file lies; return that and its lines below the header."""
    above, delimiter, header = options.get("skip_rows"), options.get("delimiter"), options.get("header")
    data: Iterator[str] = itertools.islice(_data_lines(stream, text.comments), above or 0, None)
    first = list(itertools.islice(data, _FIRST_LINES))
    if not first:
        raise InputError(f"{path}: the file holds no rows; check that this is the data file")
    if delimiter is None and above is None and (match := _SEP.fullmatch(first[0])):
        delimiter, first = match[1], first[1:]
    layout = find_layout(first, delimiter=delimiter, header=header)
    ended = first[layout.first :]
    if layout.delimiter != _TERMINATOR and all(line.rstrip().endswith(_TERMINATOR) for line in ended[:-1] or ended):
        # Each line is a statement of its own, as a microcontroller prints it, or the row of a matrix.
        first, data = [_unterminated(line) for line in first], map(_unterminated, data)
        layout = find_layout(first, delimiter=layout.delimiter, header=header)
    if above is not None:
        # Where the user says how many lines to skip, the table begins there.
        layout = replace(layout, skip=0)
    if layout.width > MOST_COLUMNS:
        raise InputError(
            f"{path}: {layout.width:,} columns, more than {MOST_COLUMNS:,}; check that this is the data file, and"
            " write one with a signal in each row with a signal in each column"
        )
    text.preamble = [line.rstrip("\r\n") for line in first[: layout.skip - bool(layout.own_names)]]
    return layout, itertools.chain(first[layout.first :], data)


def _unterminated(line: str) -> str:
    return f"{line.rstrip().removesuffix(_TERMINATOR)}\n"


def _rows(lines: Iterable[str], layout: Layout, text: TextLines | None) -> Iterator[Row]:
    """Yield the cells of the lines; with `text` the rows of data only, and note there where others were left out."""
    rows: Iterator[Row] = (line.split() for line in lines)
    if layout.delimiter != " ":
        rows = csv.reader(lines, delimiter=layout.delimiter, skipinitialspace=True)
    if text is None:
        yield from rows
        return
    number = 0
    for row in rows:
        text.ends_within = False
        if is_data(row, layout.width):
            number += 1
            yield row
        elif all(map(is_number, filter(None, map(str.strip, row)))):
            text.cut_rows.append(number)
            text.ends_within = len(row) < layout.width
        else:
            text.text_rows.append(number)


def _told_apart(found: Table, names: list[str], delimiter: str) -> list[str]:
    """Put its place behind a name that several columns have; refuse it where a line above may tell them apart."""
    twice = dict.fromkeys(repeated(names))
    if not twice:
        return names
    preamble = found.text.preamble if found.text else []
    if any(sum(map(bool, map(str.strip, line.split(delimiter)))) > 1 for line in preamble):
        raise InputError(f"{found.path}: column {next(iter(twice))!r} occurs twice; rename one in the header")
    found.notes.append(f"columns of one name ({listed(twice, 3)}) have their places behind it, counted from 0")
    return [f"{name}.{place}" if name in twice else name for place, name in enumerate(names)]


def _named_in_rows(columns: dict[str, Any]) -> dict[str, Any]:
    """Columns named by the words that stand before them in every row, as in ``t,0.1,pwm,20,q,1.5,1.6``."""
    groups: list[tuple[str, list[Any]]] = []
    above: dict[str, Any] = {}
    for name, column in columns.items():
        if word := _same_word(column):
            groups.append((word, []))
        elif groups:
            groups[-1][1].append(column)
        else:
            above[name] = column
    if len(groups) < 2 or repeated(word for word, _ in groups) or not all(several for _, several in groups):
        return columns
    return above | {
        f"{word}[{place}]" if len(several) > 1 else word: column
        for word, several in groups
        for place, column in enumerate(several)
    }


def _same_word(column: Any) -> str:
    """Word that all cells of a column hold; empty where they differ, or where it is no word."""
    words = set(map(str.strip, column)) if isinstance(column, list) else set()
    word = words.pop().rstrip(" :=") if len(words) == 1 else ""
    return word if word[:1].isalpha() else ""


def _without_copies(names: Sequence[str], columns: Sequence[list[Part]]) -> list[int]:
    """Places of the columns without those that have name and stamps of one before, as an export repeats them."""
    first: dict[str, int] = {}
    return [
        place
        for place, name in enumerate(names)
        if first.setdefault(name, place) == place or not _same_stamps(columns[place], columns[first[name]])
    ]


def _same_stamps(one: list[Part], other: list[Part]) -> bool:
    """Whether two columns are numbers that rise from row to row, and the same ones."""
    if any(isinstance(part, list) for part in (*one, *other)):
        return False
    values = _joined(one)
    rises = len(values) > 1 and bool(np.all(np.diff(values) > 0.0))
    return rises and np.array_equal(values, _joined(other))


def _take_units(path: Path, name: str, parts: list[Part], start: int) -> str:
    """Take the unit off the cells of a column, where most of them have one, and return it."""
    matches = [[WITH_UNIT.fullmatch(cell.strip()) for cell in part] if isinstance(part, list) else [] for part in parts]
    units = Counter(match["unit"] for several in matches for match in several if match and known_unit(match["unit"]))
    if 2 * sum(units.values()) <= sum(map(len, matches)):
        return ""
    first, *others = units
    row = start
    for place, (part, several) in enumerate(zip(parts, matches, strict=True)):
        other = next((number for number, match in enumerate(several, row) if match and match["unit"] in others), None)
        if other is not None:
            raise InputError(
                f"{path}: row {other} of column {name!r} is in {others[0]}, those before in {first}; write one unit in"
                " all rows"
            )
        if several:
            parts[place] = _numbers_or_texts([
                match["number"] if match and match["unit"] == first else cell
                for cell, match in zip(part, several, strict=True)
            ])  # fmt: skip
        row += len(part)
    return first


def _note_layout(found: Table, text: TextLines, layout: Layout, names: Sequence[str]) -> None:
    """Say what of the file was not read as data, and keep the units below the header."""
    if text.preamble:
        where = "header" if layout.names else "rows"
        count = len(text.preamble)
        found.notes.append(f"{counted(count, 'line')} above the {where} {is_or_are(count)} left out")
    found.units = _units_above(text.preamble, layout.delimiter, names)
    if layout.units:
        cells = [cell.strip() for row in layout.units for cell in row if cell.strip()]
        found.notes.append(f"the row below the header is read as units and left out: {listed(cells, 12)}")
        below = [(name, cell.strip()) for row in layout.units for name, cell in zip(names, row, strict=False)]
        found.units |= {name: cell for name, cell in below if not is_number(cell)}
        found.attributes = {name: float(cell.replace(",", ".")) for name, cell in below if is_number(cell)}
    cut = text.cut_rows[: -1 if text.ends_within else None]
    for rows, what, kind in ((text.text_rows, "line", _BETWEEN), (cut, "row", _CUT)):
        if rows:
            places = listed(list(map(str, dict.fromkeys(rows))), 6)
            left = f"{counted(len(rows), what)} {kind} {is_or_are(len(rows))} left out"
            found.notes.append(f"{left}, before row {places}")
    if text.ends_within:
        found.notes.append(f"the last row is left out: {_ENDS}")


def _units_above(lines: Sequence[str], delimiter: str, names: Sequence[str]) -> dict[str, str]:
    """Units that a line above the header states of all columns but the first, as in ``Vertical Units,V,V``."""
    for line in lines:
        key, *cells = [cell.strip() for cell in line.split(delimiter)]
        while cells and not cells[-1]:
            cells.pop()
        units = [known_unit(cell) for cell in cells]
        stated = _UNITS.search(key) and len(cells) == len(names) - 1
        if stated and all(units) and not set(units) & SECONDS.keys():
            return dict(zip(names[1:], cells, strict=True))
    return {}


def _data_lines(stream: Iterable[str], comment: list[str]) -> Iterator[str]:
    """Yield the lines with data, and collect the comment lines above the first of them."""
    begun = False
    for line in _with_whole_cells(stream):
        if line.lstrip().startswith(COMMENTS):
            comment.extend([] if begun else [line])
        elif line.strip():
            begun = True
            # A list, as Python prints it, or the first or last row of a matrix in brackets.
            inside = _LIST.fullmatch(line) or _in_matrix(line)
            yield f"{inside[inside.lastindex or 1]}\n" if inside else line


def _with_whole_cells(lines: Iterable[str]) -> Iterator[str]:
    """Join lines between which a cell in quotes goes on, as the answer of an instrument with its end of line."""
    lines = iter(lines)
    for line in lines:
        several = [line]
        while "".join(several).count('"') % 2 and len(several) < _LINES_OF_CELL and (more := next(lines, None)):
            several.append(more)
        whole = "".join(several)
        # What no quote closes is a sign for inches.
        apart = len(several) == 1 or whole.count('"') % 2
        yield from several if apart else [re.sub(r"[\r\n]+", " ", whole.rstrip("\r\n")) + "\n"]


def _in_matrix(line: str) -> re.Match[str] | None:
    """Numbers that the brackets around a matrix open or close with."""
    found = _LINE_OF_MATRIX.fullmatch(line)
    cells = re.findall(r"[^\s,;]+", found[found.lastindex or 0]) if found else []
    return found if cells and all(map(is_number, cells)) else None


def _numbers_or_texts(cells: Sequence[str]) -> Part:
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    except ValueError:
        return list(cells)


def _with_points(cells: Sequence[str]) -> list[str]:
    return list(map(_with_point, cells))


def _with_point(cell: str) -> str:
    """A number of a file with decimal commas; another sign between its digits is that of thousands."""
    if DECIMAL_COMMA.fullmatch(cell):
        return cell.replace(",", ".")
    grouped = GROUPED.fullmatch(cell.strip())
    return cell if grouped is None or grouped["sign"] == "," else joined_groups(grouped)


def _may_be_thousands(cell: str) -> bool:
    """Whether a number with a point may be one with groups of thousands."""
    grouped = GROUPED.fullmatch(cell.strip())
    return grouped is not None and grouped["sign"] == "."


def _joined(parts: Sequence[Part]) -> Array | list[Any]:
    """A whole column, as numbers if all parts are."""
    if all(isinstance(part, np.ndarray) for part in parts):
        return np.concatenate(parts) if parts else np.empty(0)
    return [cell for part in parts for cell in part]


class _Columns:
    """The columns read so far."""

    def __init__(self, path: Path, width: int, start: int, *, commas: bool) -> None:
        self.columns: list[list[Part]] = [[] for _ in range(width)]
        self.used_width = 0  # columns up to the last one that is not empty
        self.has_points = False  # whether a number is written with a decimal point
        self.start = start
        self._path, self._commas = path, commas
        self._rows, self._bytes = start, 0
        # First row of each length below the width, and the first that goes on beyond it.
        self._short: dict[int, int] = {}
        self._long: tuple[int, int] | None = None

    def read(self, rows: Iterator[Row], selected: slice) -> None:
        """Read the selected rows."""
        passed = sum(1 for _ in itertools.islice(rows, self.start))
        rows = itertools.islice(rows, None if selected.stop is None else selected.stop - self.start)
        while several := list(itertools.islice(rows, max(1, _CELLS // max(len(self.columns), 1)))):
            self._add(several)
        if self.start and self._rows == self.start:
            raise InputError(
                f"{self._path}: rows {self.start} to {selected.stop} do not lie within its {passed} rows; correct"
                " `rows:`"
            )

    def _add(self, rows: list[Row]) -> None:
        width = len(self.columns)
        for number, row in enumerate(rows, self._rows):
            if len(row) < width:
                self._short.setdefault(len(row), number)
                row.extend([""] * (width - len(row)))
            elif len(row) > width and self._long is None and any(cell.strip() for cell in row[width:]):
                self._long = number, len(row)
        self._rows += len(rows)
        written_with_commas = not (self._commas or self.has_points) and any("," in cell for row in rows for cell in row)
        for index, (parts, written) in enumerate(zip(self.columns, zip(*rows, strict=False), strict=False)):
            if index >= self.used_width and any(map(str.strip, written)):
                self.used_width = index + 1
            cells = _with_points(written) if self._commas else written
            part = _numbers_or_texts(cells)
            pointed = [] if self.has_points or not isinstance(part, np.ndarray) else [c for c in cells if "." in c]
            if pointed and not (written_with_commas and all(map(_may_be_thousands, pointed))):
                self.has_points = True
            elif pointed:
                # 1.234 may be a thousand as well: what it is shows in other columns.
                part = list(cells)
            self._bytes += part.nbytes if isinstance(part, np.ndarray) else _TEXT_CELL * len(part)
            parts.append(part)
        if self._bytes > MOST_TABLE:
            raise InputError(
                f"{self._path}: {self._rows:,} rows of its {width} columns take more than {MOST_TABLE >> 30} GiB;"
                " cut the file, or leave columns out"
            )

    def check_lengths(self, width: int, delimiter: str) -> None:
        """Refuse a row that is shorter than the used width of the table, or longer than the table."""
        short = min(((number, length) for length, number in self._short.items() if length < width), default=None)
        if short is not None and (self._long is None or short < self._long):
            row, length, advice = *short, "the file is damaged or cut off there"
        elif self._long is None:
            return
        elif delimiter == ",":
            row, length, advice = *self._long, "save it with ; between the columns if its numbers have decimal commas"
        else:
            row, length, advice = *self._long, "set `csv: {delimiter: ...}` in the mapping, or correct the row"
        raise InputError(f"{self._path}: row {row} has {length} cells instead of {width}; {advice}")


def _encoding(path: Path) -> tuple[str, list[str]]:
    """Return the encoding of a file, and a note where it is neither UTF-8 nor UTF-16."""
    with path.open("rb") as stream:
        if stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) and _is_utf16(path):
            return "utf-16", []
        stream.seek(0)
        decoder, place = codecs.getincrementaldecoder("utf-8")(), 0
        for block in itertools.chain(iter(lambda: stream.read(_BLOCK), b""), [b""]):
            # A character may begin in one block and end in the next.
            place -= len(decoder.getstate()[0])
            try:
                decoder.decode(block, final=not block)
            except UnicodeDecodeError as error:
                return _eight_bits(path, f"{error.reason} at byte {place + error.start}")
            place = stream.tell()
    return "utf-8-sig", []


def _is_utf16(path: Path) -> bool:
    try:
        with path.open(encoding="utf-16", newline="") as stream:
            # To the end of the file, which must be valid as a whole.
            return sum("\n" in block or "\r" in block for block in iter(lambda: stream.read(_BLOCK), "")) > 0
    except UnicodeError:
        return False


def _eight_bits(path: Path, reason: str) -> tuple[str, list[str]]:
    """Return a one-byte encoding, in which Windows writes ° and µ; control characters are a sign of binary data."""
    known = "cp1252"
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            if any(byte < 0x20 and byte not in b"\t\n\v\f\r\x1a" for byte in set(block)):
                raise InputError(
                    f"{path}: not a text file ({reason}); check that this is the data file, or save it as CSV in UTF-8"
                )
            try:
                block.decode(known)
            except UnicodeDecodeError:
                known = "latin-1"
    name = "Windows-1252" if known == "cp1252" else "Latin-1"
    return known, [f"it is not in UTF-8 and read as {name}"]


def _header_in_comment(comment: Sequence[str], delimiter: str, width: int) -> tuple[Row, tuple[Row, ...]]:
    """Names of the columns, and rows of units below them, in the last comments above the first row."""
    names, units = _cells_in_comment("".join(comment[-1:]), delimiter, width), list[Row]()
    if names and are_units(names) and (above := _cells_in_comment("".join(comment[-2:-1]), delimiter, width)):
        names, units = above, [names]
    return names, tuple(units)


def _cells_in_comment(line: str, delimiter: str, width: int) -> Row:
    """Cells of a header in a comment, as numpy.savetxt writes it; empty where it is none."""
    text = line.strip().lstrip("".join(COMMENTS)).strip()
    cells = text.split() if delimiter == " " else [cell.strip() for cell in text.split(delimiter)]
    return cells if len(cells) == width > 1 and not any(map(is_number, cells)) else []


def _has_decimal_commas(path: Path, columns: Iterable[Iterable[Part]]) -> bool:
    """Whether numbers are written as 0,5; refused where they could be thousands as well."""
    found, sure = "", False
    for cell in (cell for parts in columns for part in parts if isinstance(part, list) for cell in part):
        match = DECIMAL_COMMA.fullmatch(cell)
        grouped = GROUPED.fullmatch(cell.strip())
        if grouped and grouped["sign"] == "," and (grouped["part"] or grouped["groups"].count(",") > 1):
            return False  # a comma stands between thousands here
        if match is None:
            if "," not in cell and "." in cell and is_number(cell) and not _may_be_thousands(cell):
                return False  # a point is the decimal sign here
            continue
        found = found or cell.strip()
        # 1,234 may be a thousand; 0,234 and 1,23 cannot.
        sure = sure or len(match[2]) != 3 or match[1].lstrip("0") == "" or len(match[1]) > 3
    if found and not sure:
        raise InputError(
            f'{path}: {found!r} may be a decimal number or a thousand; set `csv: {{decimal: ","}}` in the mapping, or '
            "save the file without separators of thousands"
        )
    return sure
