"""Columns in pairs, the stamps and the values of each signal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from idloop.arrays import Mask
from idloop.records.formats.clock_names import clock_unit
from idloop.records.tables.csv_layout import repeated


def clocks_of(names: Sequence[str]) -> dict[int, int]:
    """Return the column with the stamps of each, by places: where several of one name hold stamps, the last before it.

    `names`: as the header has them: ``Time``, ``Value``, ``Time``, ``Value``.
    """
    stamps = [name for name in repeated(names) if clock_unit(name) is not None]
    found: dict[int, int] = {}
    clock = None
    for place, name in enumerate(map(str.strip, names)):
        if name in stamps:
            clock = place
        elif clock is not None:
            found[place] = clock
    return found


def numbered(names: Iterable[str]) -> list[str]:
    """Return names of which each but the first of its kind has its number behind it."""
    before: Counter[str] = Counter()
    found = []
    for name in names:
        before[name] += 1
        found.append(f"{name} ({before[name]})" if before[name] > 1 else name)
    return found


def are_alike(columns: Sequence[Any]) -> bool:
    """Whether columns of stamps, (n,) or lists of texts, are all the same."""
    return all(_equal(columns[0], other) for other in columns[1:])


def cut_at_ends(columns: dict[str, Any], clocks: Mapping[str, str]) -> None:
    """Cut each column where its stamps end.

    `columns`: what was read less often than the others ends in empty cells.
    `clocks`: column of the stamps by that of the values.
    """
    for clock in set(clocks.values()):
        known = _known(columns[clock])
        for name in (clock, *(name for name, own in clocks.items() if own == clock)):
            column = columns[name]
            columns[name] = column[known] if isinstance(column, np.ndarray) else _at(column, known)


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    return list(one) == list(other)


def _known(column: Any) -> Mask:
    """Which cells hold something."""
    if isinstance(column, np.ndarray):
        return np.isfinite(column)
    return np.array([bool(str(cell).strip()) for cell in column])


def _at(cells: list[Any], known: Mask) -> list[Any]:
    return [cell for cell, good in zip(cells, known, strict=True) if good]
