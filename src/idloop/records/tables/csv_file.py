"""The columns of a CSV file, read line by line: numbers take eight bytes each, whatever they were written as."""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.spelling import listed

Row: TypeAlias = list[str]

# What a line that is no data begins with.
_COMMENT = ("#", "%")
# Lines from which the delimiter, the header and the units below it are told.
_LOOKED_AT = 20
# Rows of units, types or descriptions below a header, at most.
_UNIT_ROWS = 3
_COMMA = re.compile(r"\s*[+-]?(\d*),(\d+)(?:[eE][+-]?\d+)?\s*")
# Cells that are turned into numbers at once, and bytes of a file that are looked at.
_STRETCH, _BLOCK = 500_000, 1 << 24
# Bytes that a cell takes as a text.
_TEXT_CELL = 64


def read_csv(path: Path, options: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Read the columns of a file, and what had to be found out about how it is written.

    Parameters
    ----------
    path : Path
    options : dict
        ``delimiter``, ``header``, ``skip_rows``, ``decimal``.

    Returns
    -------
    columns : dict of str to ndarray (n,) or list of str
        Numbers where every cell is one or empty (NaN), texts otherwise.
    notes : list of str

    Raises
    ------
    InputError
        No table of the kind, or one that takes more than `MOST_TABLE`.
    """
    encoding, notes = _encoding(path)
    with path.open(encoding=encoding, newline="") as stream:
        lines = _Lines(stream)
        try:
            return _read(path, lines, options, notes)
        except csv.Error as error:
            raise InputError(f"{path}: cannot be read as a table ({error}); check that this is the data file") from None


def _read(path: Path, lines: _Lines, options: dict[str, Any], notes: list[str]) -> tuple[dict[str, Any], list[str]]:
    data = itertools.islice(lines, int(options.get("skip_rows") or 0), None)
    begin = list(itertools.islice(data, _LOOKED_AT))
    if not begin:
        raise InputError(f"{path}: the file holds no rows; check that this is the data file")
    commas = options.get("decimal") == ","
    delimiter = options.get("delimiter") or _delimiter(begin, commas=commas)
    every = itertools.chain(begin, data)
    rows: Iterator[Row]
    if delimiter == " ":
        rows = (line.split() for line in every)
    else:
        rows = csv.reader(every, delimiter=delimiter, skipinitialspace=True)
    head = list(itertools.islice(rows, _LOOKED_AT))
    width = len(head[0])
    if width > MOST_COLUMNS:
        raise InputError(f"{path}: {width:,} columns, more than {MOST_COLUMNS:,}; check that this is the data file")
    header = options.get("header")
    if header is None:
        header = not all(_is_number(cell) for cell in head[0] if cell.strip())
        if not header and (names := _names_in_comment(lines.said, delimiter, width)):
            head, header = [names, *head], True
    names = (
        [cell.strip() or str(index) for index, cell in enumerate(head[0])] if header else list(map(str, range(width)))
    )
    body, used = (head[1:], _used(head[:1])) if header else (head, 0)
    if header:
        body, units = _without_units(body)
        if units:
            notes.append(f"the row below the header is taken for units and left out: {listed(units, 12)}")
            used = max(used, _used(head[1 : len(head) - len(body)]))
    stretch = _Stretch(path, width, commas=commas)
    for several in _stretches(itertools.chain(body, rows), width):
        stretch.add(several)
    # A delimiter at the end of every line makes a column of nothing.
    width = max(1, min(width, max(used, stretch.used)))
    stretch.check_widths(width, delimiter)
    names = names[:width]
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise InputError(f"{path}: column {twice!r} occurs twice; rename one in the header")
    columns = dict(zip(names, stretch.columns, strict=False))
    if not commas and _has_decimal_commas(path, columns.values(), points=stretch.points):
        for column in columns.values():
            column.use_points()
        notes.append("its numbers are read with decimal commas")
    return {name: column.values() for name, column in columns.items()}, notes


class _Lines:
    """Lines of a file that hold data; `said` is the comment above the first of them."""

    def __init__(self, stream: Iterable[str]) -> None:
        self._stream = iter(stream)
        self._begun = False
        self.said = ""

    def __iter__(self) -> Iterator[str]:
        for line in self._stream:
            if line.lstrip().startswith(_COMMENT):
                self.said = self.said if self._begun else line
            elif line.strip():
                self._begun = True
                yield line


class _Column:
    """Cells in the order of the file: stretches of numbers, and of texts where one of them is no number."""

    def __init__(self) -> None:
        self.parts: list[NDArray[np.float64] | list[str]] = []

    def use_points(self) -> None:
        """Read what is written with a decimal comma."""
        self.parts = [
            part if isinstance(part, np.ndarray) else _numbers_or_texts([_with_point(cell) for cell in part])
            for part in self.parts
        ]

    def texts(self) -> Iterator[str]:
        """Cells of the stretches that are no numbers."""
        for part in self.parts:
            if isinstance(part, list):
                yield from part

    def values(self) -> NDArray[np.float64] | list[Any]:
        """Everything, as numbers if it can be."""
        if all(isinstance(part, np.ndarray) for part in self.parts):
            return np.concatenate(self.parts) if self.parts else np.empty(0)
        return [cell for part in self.parts for cell in part]


def _numbers_or_texts(cells: Sequence[str]) -> NDArray[np.float64] | list[str]:
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    except ValueError:
        return list(cells)


@dataclass
class _Stretch:
    """What has been read of a table so far.

    Attributes
    ----------
    used : int
        Columns up to the last one in which something stands.
    points : bool
        A number is written with a decimal point.
    """

    path: Path
    width: int
    commas: bool
    used: int = 0
    points: bool = False
    columns: list[_Column] = field(default_factory=list)
    _rows: int = 0
    _bytes: int = 0
    # First row of each length below the width, and the first that goes on beyond it.
    _short: dict[int, int] = field(default_factory=dict)
    _long: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        self.columns = [_Column() for _ in range(self.width)]

    def add(self, rows: list[Row]) -> None:
        """Take the next rows."""
        for number, row in enumerate(rows, self._rows):
            if len(row) < self.width:
                self._short.setdefault(len(row), number)
                row.extend([""] * (self.width - len(row)))
            elif len(row) > self.width and self._long is None and any(cell.strip() for cell in row[self.width :]):
                self._long = number, len(row)
        self._rows += len(rows)
        for index, (column, written) in enumerate(zip(self.columns, zip(*rows, strict=False), strict=False)):
            if index >= self.used and any(map(str.strip, written)):
                self.used = index + 1
            cells = [cell.replace(",", ".") for cell in written] if self.commas else written
            part = _numbers_or_texts(cells)
            self.points = self.points or (isinstance(part, np.ndarray) and any("." in cell for cell in cells))
            self._bytes += part.nbytes if isinstance(part, np.ndarray) else _TEXT_CELL * len(part)
            column.parts.append(part)
        if self._bytes > MOST_TABLE:
            raise InputError(
                f"{self.path}: {self._rows:,} rows of its {self.width} columns take more than {MOST_TABLE >> 30} GiB;"
                " cut the file, or leave columns out"
            )

    def check_widths(self, width: int, delimiter: str) -> None:
        """Refuse a row that is shorter than what is used of the table, or goes on beyond it."""
        short = min(((number, length) for length, number in self._short.items() if length < width), default=None)
        if short is not None and (self._long is None or short < self._long):
            raise InputError(
                f"{self.path}: row {short[0]} has {short[1]} cells instead of {width}; the file is damaged or cut off"
                " there"
            )
        if self._long is not None:
            cure = (
                "save it with ; between the columns if its numbers have decimal commas"
                if delimiter == ","
                else "say `csv: {delimiter: ...}` in the mapping, or mend the row"
            )
            raise InputError(f"{self.path}: row {self._long[0]} has {self._long[1]} cells instead of {width}; {cure}")


def _stretches(rows: Iterator[Row], width: int) -> Iterator[list[Row]]:
    count = max(1, _STRETCH // max(width, 1))
    while several := list(itertools.islice(rows, count)):
        yield several


def _used(rows: Iterable[Row]) -> int:
    """Columns up to the last one in which something stands."""
    return max((index + 1 for row in rows for index, cell in enumerate(row) if cell.strip()), default=0)


def _encoding(path: Path) -> tuple[str, list[str]]:
    """How a file is written, and what of it had to be found out."""
    with path.open("rb") as stream:
        if stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) and _is_utf16(path):
            return "utf-16", []
        stream.seek(0)
        decoder, place = codecs.getincrementaldecoder("utf-8")(), 0
        for block in itertools.chain(iter(lambda: stream.read(_BLOCK), b""), [b""]):
            # The beginning of a letter may wait for its end in the next block.
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
            # To its end, for it must be so as a whole.
            return sum("\n" in block or "\r" in block for block in iter(lambda: stream.read(_BLOCK), "")) > 0
    except UnicodeError:
        return False


def _eight_bits(path: Path, reason: str) -> tuple[str, list[str]]:
    """One of the encodings that have a byte for each letter, as Windows writes ° and µ; binary data never look so."""
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


def _names_in_comment(line: str, delimiter: str, width: int) -> Row:
    """Names of the columns in the comment above the first row, as numpy.savetxt writes them; empty without any."""
    text = line.strip().lstrip("".join(_COMMENT)).strip()
    cells = text.split() if delimiter == " " else [cell.strip() for cell in text.split(delimiter)]
    return cells if len(cells) == width > 1 and not any(map(_is_number, cells)) else []


def _without_units(body: list[Row]) -> tuple[list[Row], Row]:
    """Rows of data, and the cells of a row of units above them: no number stands there where the next row has some."""
    for count in range(1, min(_UNIT_ROWS, len(body) - 1) + 1):
        above, below = body[count - 1], body[count]
        told = [cell.strip() for cell in above if cell.strip()]
        if not told or any(_is_number(cell) for cell in told):
            break
        if any(_is_number(cell) for cell in below if cell.strip()):
            return body[count:], [cell.strip() for row in body[:count] for cell in row if cell.strip()]
    return body, []


def _has_decimal_commas(path: Path, columns: Iterable[_Column], *, points: bool) -> bool:
    """Whether numbers are written as 0,5; refused where they could be thousands as well."""
    if points:
        return False  # a point is the decimal sign here
    found, sure = "", False
    for cell in itertools.chain.from_iterable(column.texts() for column in columns):
        match = _COMMA.fullmatch(cell)
        if match is None:
            if "," not in cell and "." in cell and _is_number(cell):
                return False
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
