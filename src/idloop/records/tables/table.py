"""Named columns of a file, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.tables.csv_file import CsvTable
from idloop.spelling import did_you_mean, listed


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
        What was found out about the format of the file.
    units : dict of str to str
        Units of columns, as the file writes them.
    clocks : dict of str to str
        Where columns have stamps of their own: the column that holds those of each. Its unit is in `units` where it is
        not s.
    stamp_parts : tuple of str
        Columns with the seconds and the rest of a stamp that a third one has as a whole.
    first_row : int
        Row of the file with which the columns begin.
    parts : dict of str to (float, float)
        Records within the file by name: their stamps from .. to (excluded), as the clock of the columns counts them.
    begins : tuple of int
        Rows at which records within the file begin, where it keeps them apart.
    csv : CsvTable or None
        Of a text file, what was found about its layout.
    """

    path: Path
    columns: dict[str, Any]
    attributes: dict[str, float | str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    stamp_parts: tuple[str, ...] = ()
    first_row: int = 0
    parts: dict[str, tuple[float, float]] = field(default_factory=dict)
    begins: tuple[int, ...] = ()
    csv: CsvTable | None = None

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

    def numbers(self, name: str | int, rows: slice = slice(None)) -> Array:
        """Return a column, or some rows of it, as floats (n,); an empty cell is NaN.

        Raises
        ------
        InputError
            Unknown column, or a cell that is no number.
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
