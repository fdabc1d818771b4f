"""Named columns of a file, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.spelling import check_known


@dataclass
class TextLines:
    """What else the lines of a text file hold."""

    comments: list[str] = field(default_factory=list)  # above the first row, marked as such
    preamble: list[str] = field(default_factory=list)  # above the header
    # Rows before which lines without data, and rows of numbers with more or fewer cells, were left out
    text_rows: list[int] = field(default_factory=list)
    cut_rows: list[int] = field(default_factory=list)
    ends_within: bool = False  # whether the last of these rows is the last line of the file

    @property
    def skipped(self) -> bool:
        """Whether lines between the rows were left out."""
        return bool(self.text_rows or self.cut_rows)


@dataclass
class Table:
    """Columns of a file, converted to numbers only when asked for."""

    path: Path  # where it came from, for messages
    columns: dict[str, Any]  # lists of texts, or arrays, in the order of the file
    attributes: dict[str, float | str] = field(default_factory=dict)  # single values beside the columns
    notes: list[str] = field(default_factory=list)  # what was found out about the format of the file
    units: dict[str, str] = field(default_factory=dict)  # units of columns, as the file writes them
    # Column with the stamps of each, where columns have stamps of their own; its unit is in `units` where it is not s
    clocks: dict[str, str] = field(default_factory=dict)
    stamp_parts: tuple[str, ...] = ()  # columns with the seconds and the rest of stamps that a third one has
    first_row: int = 0  # row of the file with which the columns begin
    # Records within the file by name: their stamps from .. to (excluded), as the clock of the columns counts them
    parts: dict[str, tuple[float, float]] = field(default_factory=dict)
    begins: tuple[int, ...] = ()  # rows at which records within the file begin, where it keeps them apart
    text: TextLines | None = None  # of a text file

    def __contains__(self, name: str | int) -> bool:
        """Whether there is such a column, by name or by position from 0."""
        return 0 <= name < len(self.columns) if isinstance(name, int) else name in self.columns

    @property
    def of_record(self) -> list[str]:
        """Names of the columns that are as long as the record; beside it a workspace holds settings and models."""
        longest = 0 if self.clocks else max(map(len, self.columns.values()), default=0)
        return [name for name, column in self.columns.items() if 2 * len(column) > longest]

    def raw(self, name: str | int) -> Any:
        """Return a column as read, by name or by position from 0."""
        if isinstance(name, str):
            check_known(name, self.columns, f"{self.path}: no column")
            return self.columns[name]
        if name not in self:
            raise InputError(f"{self.path}: no column {name}; there are {len(self.columns)}, counted from 0")
        return list(self.columns.values())[name]

    def numbers(self, name: str | int, rows: slice = slice(None)) -> Array:
        """Return a column, or some rows of it, as floats (n,); an empty cell is NaN.

        Raises InputError: unknown column, or a cell that is no number.
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

    def add_series(self, name: str, stamps: Any, values: Any, unit: str, clock: str = "time") -> None:
        """Add a column with stamps of its own, which become ``name.clock``, in a unit; empty where it is not known."""
        own = f"{name}.{clock}"
        self.columns |= {name: values, own: stamps}
        self.clocks[name] = own
        self.units |= {own: unit} if unit else {}

    def set_series(self, series: Mapping[str, tuple[Any, Any]], clock: str, unit: str) -> None:
        """Make series of stamps and values the columns, with one column of stamps where all have the same."""
        self.columns = {}
        first, *others = [np.asarray(stamps) for stamps, _ in series.values()]
        if all(np.array_equal(first, other) for other in others):
            self.columns = {clock: next(iter(series.values()))[0]} | {name: one for name, (_, one) in series.items()}
            self.units |= {clock: unit} if unit else {}
            return
        for name, (stamps, values) in series.items():
            self.add_series(name, stamps, values, unit, clock)


def joined_tables(folder: Path, tables: Sequence[Table]) -> Table:
    """Join tables of one experiment, each with its own time: the column ``u`` of ``drive.csv`` becomes ``drive.u``."""
    whole = Table(folder, {})
    for table in tables:
        stem = table.path.stem
        whole.columns |= {f"{stem}.{name}": column for name, column in table.columns.items()}
        whole.units |= {f"{stem}.{name}": unit for name, unit in table.units.items()}
        whole.clocks |= {f"{stem}.{name}": f"{stem}.{clock}" for name, clock in table.clocks.items()}
        whole.attributes |= {f"{stem}.{name}": value for name, value in table.attributes.items()}
        whole.notes += [f"{table.path.name}: {note}" for note in table.notes]
        whole.first_row = table.first_row
    return whole
