"""Tables with a row for each value: a column of names, one of values and one of stamps, as databases export them."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.records.formats.clock_names import clock_unit
from idloop.records.tables.series import set_series
from idloop.records.tables.table import Table
from idloop.spelling import joined_names, listed

_MOST_NAMES, _FEWEST_ROWS = 64, 10
_VALUES = {"value", "values", "varvalue", "val", "wert", "valor", "valeur", "valore", "waarde", "reading"}


def spread_names(table: Table) -> None:
    """Make each name of a table with a row for each value a column with the stamps of its rows; leave others alone."""
    found = _long(table)
    if found is None:
        return
    names, values, stamps = found
    label = _labels(table, names)
    when, what = np.asarray(table.columns[stamps]), np.asarray(table.columns[values], dtype=np.float64)
    series = {name: np.flatnonzero(label == name) for name in dict.fromkeys(label.tolist()) if name}
    unit = table.units.get(stamps, "") or clock_unit(stamps) or ""
    table.units = {}
    set_series(table, {name: (when[rows], what[rows]) for name, rows in series.items()}, stamps, unit)
    said = f"{joined_names(list(map(repr, names)))} {'name' if len(names) > 1 else 'names'} it"
    table.notes.append(
        f"each row holds one value: {said} ({listed(list(series), 6)}), {values!r} is it, {stamps!r} is its time"
    )


def _labels(table: Table, names: list[str]) -> NDArray[Any]:
    """Name of the signal of each row, of several columns the names in a row."""
    return np.array([".".join(str(cell).strip() for cell in row) for row in zip(*map(table.raw, names), strict=True)])


def _long(table: Table) -> tuple[list[str], str, str] | None:
    """Columns of the names, of the values and of the stamps of a table with a row for each value; None for others."""
    times = [name for name in table.columns if clock_unit(name) is not None]
    texts = {
        name: column
        for name, column in table.columns.items()
        if name not in times and len(column) and all(isinstance(cell, str) for cell in column)
    }
    names = [name for name, column in texts.items() if _are_names(column)]
    if not names or not times:
        return None
    label = _labels(table, names)
    # A topic and a path within it name a signal together; a state that changes by itself is none of it.
    if len(set(label.tolist())) > max(len(set(texts[name])) for name in names):
        return None
    free = [
        name
        for name, column in table.columns.items()
        if isinstance(column, np.ndarray) and name not in times and _varies(column, label)
    ]
    said = [name for name in free if name.strip("_ ").lower() in _VALUES]
    # Phases of one run follow each other; values of several signals have stamps in common.
    together = any(count > 1 for count in Counter(np.asarray(table.columns[times[0]]).tolist()).values())
    values = said or (free if together else [])
    return (names, values[0], times[0]) if len(values) == 1 else None


def _are_names(column: list[str]) -> bool:
    counts = Counter(cell.strip() for cell in column)
    return 2 <= len(counts) <= _MOST_NAMES and min(counts.values()) >= _FEWEST_ROWS and all(counts)


def _varies(column: Array, label: NDArray[Any]) -> bool:
    """Whether a column changes among the rows of one name."""
    if column.dtype.kind not in "fiu":
        return False
    known = np.isfinite(column)
    return any(
        float(np.ptp(column[rows])) > 0.0 for one in set(label.tolist()) if (rows := (label == one) & known).any()
    )
