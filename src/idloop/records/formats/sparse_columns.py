"""Columns that are mostly empty cells get stamps of their own.

Recorders that write several series into one table, such as the export of PlotJuggler, have one row for each stamp of
any series and leave the cells of the others empty.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from idloop.records.tables.table import Table
from idloop.spelling import listed

# Share of empty cells from which a column is a series of its own: no recording loses a third of its samples.
_EMPTY = 0.33


def with_own_stamps(table: Table, time: str) -> Table:
    """Return the table with the empty cells of its sparse columns left out, and the stamps of the others beside them.

    Parameters
    ----------
    table : Table
        Of one time base.
    time : str
        Column of its stamps.

    Returns
    -------
    Table
        Each sparse column has only its filled cells; ``name.time`` has their stamps and is its clock. The table itself
        where no column is sparse.
    """
    stamps = table.raw(time)
    columns, clocks, units, found = dict(table.columns), dict(table.clocks), dict(table.units), []
    for name, cells in table.columns.items():
        clock = f"{name}.time"
        if name == time or name in clocks or len(cells) != len(stamps) or clock in columns:
            continue
        filled = _filled(cells)
        if len(filled) == 0 or len(filled) > (1.0 - _EMPTY) * len(cells):
            continue
        columns[name], columns[clock] = _taken(cells, filled), _taken(stamps, filled)
        clocks[name] = clock
        if time in units:
            units[clock] = units[time]
        found.append(name)
    if not found:
        return table
    note = f"columns whose cells are mostly empty have stamps of their own: {listed(found)}"
    return replace(table, columns=columns, clocks=clocks, units=units, notes=[*table.notes, note])


def _filled(cells: Any) -> Any:
    if isinstance(cells, np.ndarray):
        return np.flatnonzero(~np.isnan(cells)) if cells.dtype.kind == "f" else np.arange(len(cells))
    return [k for k, cell in enumerate(cells) if cell is not None and (not isinstance(cell, str) or cell.strip())]


def _taken(cells: Any, places: Any) -> Any:
    return cells[places] if isinstance(cells, np.ndarray) else [cells[k] for k in places]
