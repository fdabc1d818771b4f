"""Text files with one block for each signal: a title, then rows of a stamp and a value."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, check_size, lines_of, text_of
from idloop.records.tables.base_units import clock_unit
from idloop.records.tables.table import Table

_SPLIT = re.compile(r"\s*[;,\t]\s*|\s+")
# Rows that a block has at least in the beginning of a file that is recognised as of this form.
_LEAST_ROWS = 3
_FIRST_LINES = 50


@dataclass
class _Block:
    """Lines of text, and the rows of numbers below them."""

    titles: list[str] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)

    @property
    def name(self) -> str:
        """First line that is no header of the columns."""
        return next((one for one in self.titles if _header(one) is None), "")

    @property
    def clock_unit(self) -> str:
        """Unit of the stamps, where a header says it."""
        return next((unit for one in self.titles if (unit := _header(one))), "")

    @property
    def is_series(self) -> bool:
        """Whether its rows are a stamp and a value each."""
        return {len(row) for row in self.rows} == {2}


def read_blocks(path: Path, _: Options) -> Table:
    """Read the signals of a file, each with its own stamps."""
    check_size(path, "keep fewer rows", MOST_TABLE // 8)
    table = Table(path, {})
    for block in _blocks(lines_of(path)):
        name = block.name
        if not block.rows:
            continue
        if not name or name in table.columns:
            raise InputError(
                f"{path}: a block of {len(block.rows)} rows has {'the title of another' if name else 'no title'};"
                " give each block a line with its name"
            )
        if not block.is_series:
            raise InputError(f"{path}: {name[:40]!r} has rows of other than a stamp and a value; correct the file")
        stamps, values = np.array(block.rows).T
        table.add_series(name, stamps, values, block.clock_unit)
        if len(table.columns) > MOST_COLUMNS:
            raise InputError(f"{path}: more than {MOST_COLUMNS:,} columns; check that this is the data file")
    return table


def _blocks(lines: Iterable[str], most: int | None = None) -> Iterator[_Block]:
    """Yield the blocks; of `most` rows or more the first ones and the last one, where only their kind is asked for."""
    block = _Block()
    for line in lines:
        text = line.strip()
        if not text:
            continue
        row = _numbers(text)
        if row is None:
            if block.rows:
                yield block
                block = _Block()
            block.titles.append(_title(text))
        elif most is None or len(block.rows) < most:
            block.rows.append(row)
        else:
            block.rows[-1] = row
    yield block


def _title(text: str) -> str:
    """A line without the signs of a comment or a section."""
    text = text.lstrip("#% ").rstrip(":").strip('" ')
    return text[1:-1].strip() if text.startswith("[") and text.endswith("]") and text.count("[") == 1 else text


def _numbers(text: str) -> list[float] | None:
    commas = ";" in text or "\t" in text
    cells = re.split(r"\s*[;\t]\s*", text) if commas else _SPLIT.split(text)
    try:
        return [float(cell.replace(",", ".") if commas else cell) for cell in cells]
    except ValueError:
        return None


def _header(title: str) -> str | None:
    """Unit of the stamps where a line is the header of two columns, the first of stamps; None where it is no header."""
    cells = [cell for cell in re.split(r"\s*[;,\t]\s*", title) if cell]
    if len(cells) == 1:
        cells = title.split()
    return clock_unit(cells[0]) if len(cells) in (2, 3) else None


def _goes_on_as_blocks(path: Path) -> bool:
    """Whether a first block that is longer than the beginning of the file is followed by a second one."""
    if path.stat().st_size > MOST_TABLE // 8:
        return False
    lines = lines_of(path)
    # A table with a header, or of another width, is none: that the first rows show.
    first = list(itertools.islice(lines, _FIRST_LINES))
    # The last row of a block and the first of the next one tell them apart.
    return _are_blocks(_blocks(first), least=1) and _are_blocks(
        _blocks(itertools.chain(first, lines), most=2 * _LEAST_ROWS), least=2
    )


def _are_blocks(blocks: Iterable[_Block], least: int) -> bool:
    """Whether there are as many blocks, each with a title of its own and stamps that begin anew."""
    whole = [block for block in blocks if block.rows]
    if len(whole) < least or any(len(block.rows) < _LEAST_ROWS for block in whole[:-1]):
        return False
    names = [block.name for block in whole]
    if not all(names) or len(set(names)) < len(names) or not all(block.is_series for block in whole):
        return False
    return all(after.rows[0][0] <= before.rows[-1][0] for before, after in itertools.pairwise(whole))


FORM = Form(
    "blocks",
    (),
    "text with one block for each signal",
    "a title, then rows of a stamp and a value; columns by the titles, each with its own stamps in `title.time`",
    lambda head: _are_blocks(_blocks(text_of(head).splitlines()[:-1]), least=2),
    read_blocks,
    _goes_on_as_blocks,
)
