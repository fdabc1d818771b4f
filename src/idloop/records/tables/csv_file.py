"""Columns of a CSV file, read line by line, so that a number takes eight bytes however it was written."""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.clock_names import clock_unit
from idloop.records.tables.base_units import SECONDS, known_unit
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
    repeated,
)
from idloop.records.tables.paired_columns import are_alike, clocks_of, cut_at_ends, numbered
from idloop.spelling import listed

# Consecutive cells of one column: numbers, or texts where one of them is no number.
Part: TypeAlias = NDArray[np.float64] | list[str]

# First characters of lines without data.
_COMMENT = ("#", "%")
# Lines among which the table is looked for, and rows above which its columns may be named in a comment.
_FIRST_LINES = 400
# A delimiter that Excel writes into the first line.
_SEP = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)
_TERMINATOR = ";"
_LINE_OF_MATRIX = re.compile(r"\s*(?:[\[(]+([^\[\]()]*)|([^\[\]()]*?)[\])]+\s*[;,]?\s*)")
_LIST = re.compile(r"\s*[\[(]([^\[\]()]*[^\s\[\]()][^\[\]()]*)[\])]\s*")
_UNITS = re.compile(r"\bunits?\b", re.IGNORECASE)
# Cells that are converted at once, and bytes of a file that are decoded at once.
_CELLS, _BLOCK = 500_000, 1 << 24
# What notes say of lines that were left out: texts, and rows that were cut off or run together.
BETWEEN = "of text between the rows"
CUT = "of another number of cells"
ENDS = "the file ends within it"
SKIPPED = (BETWEEN, CUT, ENDS)
# Bytes of a cell as a text.
_TEXT_CELL = 64


_LINES_OF_CELL = 3  # that a cell in quotes goes over at most
_LINE_ENDS, _LINE_END = "\r\n", r"[\r\n]+"


@dataclass
class CsvTable:
    """What a text file holds."""

    # Numbers where every cell is one or empty (NaN), texts otherwise
    columns: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what was found out about the format
    units: dict[str, str] = field(default_factory=dict)  # units of columns, from rows below the header
    attributes: dict[str, float | str] = field(default_factory=dict)  # numbers in such a row: what a column holds once
    preamble: list[str] = field(default_factory=list)  # lines above the header
    comments: list[str] = field(default_factory=list)  # those that are marked as such
    # Rows before which lines without data, and rows of numbers with more or fewer cells, were left out
    text_rows: list[int] = field(default_factory=list)
    cut_rows: list[int] = field(default_factory=list)
    ends_within: bool = False  # whether the last of these rows is the last line of the file
    # Column that holds the stamps of each, where there are several
    clocks: dict[str, str] = field(default_factory=dict)

    @property
    def skipped(self) -> bool:
        """Whether lines between the rows were left out."""
        return bool(self.text_rows or self.cut_rows)


def read_csv(path: Path, options: dict[str, Any], rows: slice = slice(0, None)) -> CsvTable:
    """Read the columns of a file.

    `options`: ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``.
    `rows`: rows of data to read; the others are not looked at.
    Raises InputError: the file is no such table, or takes more than `MOST_TABLE`.
    """
    encoding, notes = _encoding(path)
    with path.open(encoding=encoding, newline="") as stream:
        try:
            return _read(path, stream, options, CsvTable(notes=notes), rows)
        except csv.Error as error:
            raise InputError(f"{path}: cannot be read as a table ({error}); check that this is the data file") from None


def _read(path: Path, stream: TextIO, options: dict[str, Any], found: CsvTable, selected: slice) -> CsvTable:
    comment: list[str] = []
    above = options.get("skip_rows")
    data: Iterator[str] = itertools.islice(_data_lines(stream, comment), above or 0, None)
    first = list(itertools.islice(data, _FIRST_LINES))
    found.comments = comment
    if not first:
        raise InputError(f"{path}: the file holds no rows; check that this is the data file")
    delimiter = options.get("delimiter")
    if delimiter is None and above is None and (match := _SEP.fullmatch(first[0])):
        delimiter, first = match[1], first[1:]
    # Where the user says how many lines to skip, the table begins there.
    layout = find_layout(first, delimiter=delimiter, header=options.get("header"))
    ended = first[layout.first :]
    if layout.delimiter != _TERMINATOR and all(map(_is_terminated, ended[:-1] or ended)):
        # Each line is a statement of its own, as a microcontroller prints it, or the row of a matrix.
        first, data = [_unterminated(line) for line in first], map(_unterminated, data)
        layout = find_layout(first, delimiter=layout.delimiter, header=options.get("header"))
    if above is not None:
        layout = replace(layout, skip=0)
    found.preamble = [line.rstrip("\r\n") for line in first[: layout.skip - bool(layout.own_names)]]
    if layout.width > MOST_COLUMNS:
        raise InputError(
            f"{path}: {layout.width:,} columns, more than {MOST_COLUMNS:,}; check that this is the data file, and"
            " write one with a signal in each row with a signal in each column"
        )
    names, units = layout.names, layout.units
    if not names and options.get("header") is None:
        names, above_rows = _header_in_comment(comment, layout.delimiter, layout.width)
        units = (*above_rows, *units)
    if any(cell.strip() for row in layout.units for cell in row[layout.width :]):
        names = names[: layout.width]
    width = max(layout.width, len(names))
    lines = itertools.chain(first[layout.first :], data)
    rows: Iterator[Row]
    if layout.delimiter == " ":
        rows = (line.split() for line in lines)
    else:
        rows = csv.reader(lines, delimiter=layout.delimiter, skipinitialspace=True)
    if options.get("skip_text"):
        rows = _only_data(rows, layout.width, found)
    start = selected.start or 0
    passed = sum(1 for _ in itertools.islice(rows, start))
    stop = None if selected.stop is None else selected.stop - start
    rows = itertools.islice(rows, stop)
    commas = options.get("decimal") == ","
    table = _Table(path, width, start, commas=commas)
    while several := list(itertools.islice(rows, max(1, _CELLS // max(width, 1)))):
        table.add(several)
    if start and not table.count:
        raise InputError(
            f"{path}: rows {start} to {selected.stop} do not lie within its {passed} rows; correct `rows:`"
        )
    # A delimiter at the end of every line makes a column of nothing.
    width = max(1, min(width, max(_used_width([names]), table.used_width)))
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
        names, own_names, width = [names[k] for k in kept], [own_names[k] for k in kept], len(kept)
        units = tuple([row[k] for k in kept if k < len(row)] for row in units)
    if twice := dict.fromkeys(repeated(names)):
        if any(sum(map(bool, map(str.strip, line.split(layout.delimiter)))) > 1 for line in found.preamble):
            # What tells them apart may stand above.
            raise InputError(f"{path}: column {next(iter(twice))!r} occurs twice; rename one in the header")
        names = [f"{name}.{place}" if name in twice else name for place, name in enumerate(names)]
        found.notes.append(f"columns of one name ({listed(twice, 3)}) have their places behind it, counted from 0")
    columns = [table.columns[place] for place in kept]
    in_cells = {name: _take_units(path, name, parts, start) for name, parts in zip(names, columns, strict=True)}
    if not commas and not table.has_points and _has_decimal_commas(path, columns):
        columns = [[_with_points(part) for part in parts] for parts in columns]
        found.notes.append("its numbers are read with decimal commas")
    else:
        columns = [[_numbers_or_texts(part) if isinstance(part, list) else part for part in parts] for parts in columns]
    found.columns = {name: _joined(parts) for name, parts in zip(names, columns, strict=True)}
    if nameless:
        found.columns = _named_in_rows(found.columns)
    _note_layout(found, replace(layout, units=units), [*names, *layout.names[len(names) :]])
    if taken := {name: unit for name, unit in in_cells.items() if unit}:
        found.units |= taken
        said = listed([f"{name} in {unit}" for name, unit in taken.items()], 12)
        found.notes.append(f"units are read from the cells: {said}")
    for clock in set(clocks.values()):
        found.units.setdefault(names[clock], clock_unit(own_names[clock]) or "")
    if clocks:
        own = {names[place]: names[clock] for place, clock in clocks.items()}
        if not are_alike([found.columns[clock] for clock in dict.fromkeys(own.values())]):
            found.clocks = own
            cut_at_ends(found.columns, own)
    return found


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


def _is_terminated(line: str) -> bool:
    return line.rstrip().endswith(_TERMINATOR)


def _unterminated(line: str) -> str:
    return f"{line.rstrip().removesuffix(_TERMINATOR)}\n"


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


def _note_layout(found: CsvTable, layout: Layout, names: Sequence[str]) -> None:
    """Say what of the file was not read as data, and keep the units below the header."""
    if found.preamble:
        where = "header" if layout.names else "rows"
        found.notes.append(f"{_lines(found.preamble)} above the {where} {_are(found.preamble)} left out")
    found.units = _units_above(found.preamble, layout.delimiter, names)
    if layout.units:
        cells = [cell.strip() for row in layout.units for cell in row if cell.strip()]
        found.notes.append(f"the row below the header is read as units and left out: {listed(cells, 12)}")
        below = [(name, cell.strip()) for row in layout.units for name, cell in zip(names, row, strict=False)]
        found.units |= {name: cell for name, cell in below if not is_number(cell)}
        found.attributes = {name: float(cell.replace(",", ".")) for name, cell in below if is_number(cell)}
    if found.text_rows:
        places = listed(list(map(str, dict.fromkeys(found.text_rows))), 6)
        rows = found.text_rows
        found.notes.append(f"{_lines(rows)} {BETWEEN} {_are(rows)} left out, before row {places}")
    if cut := found.cut_rows[: -1 if found.ends_within else None]:
        places = listed(list(map(str, dict.fromkeys(cut))), 6)
        many = "1 row" if len(cut) == 1 else f"{len(cut)} rows"
        found.notes.append(f"{many} {CUT} {_are(cut)} left out, before row {places}")
    if found.ends_within:
        found.notes.append(f"the last row is left out: {ENDS}")


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


def _lines(some: Sequence[object]) -> str:
    return "1 line" if len(some) == 1 else f"{len(some)} lines"


def _are(some: Sequence[object]) -> str:
    return "is" if len(some) == 1 else "are"


def _only_data(rows: Iterable[Row], width: int, found: CsvTable) -> Iterator[Row]:
    """Yield the rows of numbers, and note where others were left out."""
    number = 0
    for row in rows:
        found.ends_within = False
        if is_data(row, width):
            number += 1
            yield row
        elif all(map(is_number, filter(None, map(str.strip, row)))):
            found.cut_rows.append(number)
            found.ends_within = len(row) < width
        else:
            found.text_rows.append(number)


def _data_lines(stream: Iterable[str], comment: list[str]) -> Iterator[str]:
    """Yield the lines with data, and collect the comment lines above the first of them."""
    begun = False
    for line in _with_whole_cells(stream):
        if line.lstrip().startswith(_COMMENT):
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
        yield from several if apart else [f"{re.sub(_LINE_END, ' ', whole.rstrip(_LINE_ENDS))}\n"]


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


def _with_points(part: Part) -> Part:
    """Convert numbers that were written with a decimal comma."""
    if isinstance(part, np.ndarray):
        return part
    return _numbers_or_texts(list(map(_with_point, part)))


def _with_point(cell: str) -> str:
    """A number of a file with decimal commas; another sign between its digits is that of thousands."""
    if DECIMAL_COMMA.fullmatch(cell):
        return cell.replace(",", ".")
    grouped = GROUPED.fullmatch(cell.strip())
    if grouped is None or grouped["sign"] == ",":
        return cell
    return grouped["head"] + re.sub(r"\D", "", grouped["groups"]) + (grouped["part"] or "").replace(",", ".")


def _may_be_thousands(cell: str) -> bool:
    """Whether a number with a point may be one with groups of thousands."""
    grouped = GROUPED.fullmatch(cell.strip())
    return grouped is not None and grouped["sign"] == "."


def _joined(parts: Sequence[Part]) -> Array | list[Any]:
    """A whole column, as numbers if all parts are."""
    if all(isinstance(part, np.ndarray) for part in parts):
        return np.concatenate(parts) if parts else np.empty(0)
    return [cell for part in parts for cell in part]


class _Table:
    """The columns read so far.

    Attributes
    ----------
    columns : list of list of Part
    used_width : int
        Columns up to the last one that is not empty.
    has_points : bool
        Whether a number is written with a decimal point.
    """

    def __init__(self, path: Path, width: int, start: int, *, commas: bool) -> None:
        self.columns: list[list[Part]] = [[] for _ in range(width)]
        self.used_width, self.has_points = 0, False
        self._path, self._commas = path, commas
        self._start, self._rows, self._bytes = start, start, 0
        # First row of each length below the width, and the first that goes on beyond it.
        self._short: dict[int, int] = {}
        self._long: tuple[int, int] | None = None

    @property
    def count(self) -> int:
        """Rows read."""
        return self._rows - self._start

    def add(self, rows: list[Row]) -> None:
        """Add the next rows."""
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
            cells = list(map(_with_point, written)) if self._commas else written
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
            raise InputError(
                f"{self._path}: row {short[0]} has {short[1]} cells instead of {width}; the file is damaged or cut off"
                " there"
            )
        if self._long is not None:
            advice = (
                "save it with ; between the columns if its numbers have decimal commas"
                if delimiter == ","
                else "set `csv: {delimiter: ...}` in the mapping, or correct the row"
            )
            raise InputError(
                f"{self._path}: row {self._long[0]} has {self._long[1]} cells instead of {width}; {advice}"
            )


def _used_width(rows: Iterable[Row]) -> int:
    """Columns up to the last one that is not empty."""
    return max((index + 1 for row in rows for index, cell in enumerate(row) if cell.strip()), default=0)


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
    text = line.strip().lstrip("".join(_COMMENT)).strip()
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
