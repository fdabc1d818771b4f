"""Samples that a log has lost by its own counter, while its stamps go on evenly."""

from __future__ import annotations

from collections.abc import Mapping as Map

import numpy as np

from idloop.arrays import Array
from idloop.records.recognition.column_name import is_counter, parse_column_name
from idloop.records.recognition.guess import quoted
from idloop.records.recognition.time_base import TimeBase
from idloop.records.tables.table import Table
from idloop.spelling import listed

# Share of the rows in which a counter rises by one number, and steps of the stamps that are usual, in their median.
_COUNTS, _USUAL = 0.9, 1.5
_FEWEST_ROWS = 10


def doubt_of_lost_rows(table: Table, numbers: Map[str, Array], base: TimeBase) -> str:
    """Name the rows before which a counter leaves out numbers and the stamps do not, with the time by the counter.

    Returns: empty where nothing was lost, or where the stamps show it.
    """
    step = np.diff(base.seconds)
    if base.seconds.size < _FEWEST_ROWS or len(base.runs) > 1 or not float(np.median(step)) > 0.0:
        return ""
    for name, value in numbers.items():
        counter = is_counter(parse_column_name(name, table.units.get(name, "")))
        if not counter or name in base.columns or value.size != base.seconds.size:
            continue
        rise = np.diff(value)
        usual = float(np.median(rise))
        if not usual > 0.0 or float(np.mean(rise == usual)) < _COUNTS:
            continue
        lost = np.flatnonzero((rise > usual) & (step < _USUAL * np.median(step)))
        if not lost.size:
            continue
        count = int(np.round(np.sum(rise[lost] / usual - 1.0)))
        rows = listed([str(row + 1 + table.first_row) for row in lost], 6)
        period = float(np.median(step)) / usual
        return (
            f"{name!r} leaves out {count} numbers before row {rows}, where the time goes on evenly: samples were lost,"
            f" and the time after them is too early; if each number is a sample, --time"
            f" '{quoted(name)} * {period:.6g}=s'"
        )
    return ""
