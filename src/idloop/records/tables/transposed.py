"""Text files with a row for each signal instead of a column."""

from __future__ import annotations

import numpy as np

from idloop.records.tables.table import Table

_MOST_SIGNALS, _FEWEST_SAMPLES = 64, 50
_LONGER = 10  # times as many columns as rows, of a table that is turned


def turn_rows(table: Table) -> None:
    """Make each row a column, where a text has few rows without a header and many columns; leave others alone.

    A text in the first cell of each row is its name.
    """
    count = max((len(column) for column in table.columns.values()), default=0)
    first, *others = table.columns.values()
    if not 0 < count <= _MOST_SIGNALS or len(others) < max(_FEWEST_SAMPLES, _LONGER * count):
        return
    if list(table.columns) != list(map(str, range(len(table.columns)))):
        return
    if not all(isinstance(column, np.ndarray) and column.size == count for column in others):
        return
    named = not isinstance(first, np.ndarray)
    names = [str(cell).strip() for cell in first] if named else list(map(str, range(count)))
    if len(set(names)) < count or not all(names):
        return
    rows = np.column_stack(others if named else [first, *others])
    table.columns = dict(zip(names, rows, strict=True))
    table.notes.append(f"each of its {count} rows is a signal{' with its name before it' if named else ''}")
