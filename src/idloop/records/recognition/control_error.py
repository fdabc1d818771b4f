"""The control error among the columns: the difference of a set-point and the motion that follows it."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace
from itertools import combinations

import numpy as np

from idloop.arrays import Array
from idloop.records.recognition.guess import MOTION, SET_POINTS
from idloop.records.recognition.roles import RoleByName, Signal
from idloop.records.recognition.table_column import TableColumn
from idloop.records.recognition.unnamed_columns import follows

_MAY_DIFFER = ("", *MOTION, *SET_POINTS)  # roles of two columns whose difference a control error may be
_ROUNDED = 0.01  # of the spread of each of three columns, by which rounding may leave their difference
_MOST_COMPARED = 20


def without_control_error(columns: dict[str, TableColumn], given: Container[str]) -> dict[str, TableColumn]:
    """Return the columns with the roles that a control error among them shows, where no name says them.

    It is the difference of a set-point and a motion: neither the command nor a motion itself.

    `given`: columns whose roles the user has given.
    """
    found = _found([one for one in columns.values() if one.name not in given])
    if found is None:
        return columns
    error, set_point, moved = found
    differ = f"the difference of {set_point.name!r} and {moved.name!r}"
    made = {error.name: replace(error, by_name=RoleByName("other", 0.0, ""))}
    doubt = f"{error.name!r} is {differ}, as a control error is: not used"
    if not moved.by_name.role:
        others = [one.value for one in columns.values() if one not in found and one.moves and not one.is_held]
        fast = any(follows(moved.value, one, moved.runs) for one in others)
        motion: Signal = "velocity" if fast else "position"
        doubt += f"; {moved.name!r} follows the other and is taken as the {motion}: --position or --velocity COLUMN"
        made[moved.name] = replace(moved, by_name=RoleByName(motion, 0.5, f"it follows {set_point.name!r}"))
    if not set_point.by_name.role:
        made[set_point.name] = replace(
            set_point, by_name=RoleByName("reference", 0.5, f"{moved.name!r} follows it"), doubts=(doubt,)
        )
    else:
        made[moved.name] = replace(made.get(moved.name, moved), doubts=(*moved.doubts, doubt))
    return columns | made


def _found(columns: list[TableColumn]) -> tuple[TableColumn, TableColumn, TableColumn] | None:
    """Return error, set-point and motion of the first three columns that are so; None where there are none."""
    free = [one for one in columns if one.by_name.role in _MAY_DIFFER and one.moves][:_MOST_COMPARED]
    for three in combinations(free, 3):
        nameless = [one for one in three if not one.by_name.role]
        if not nameless or len({one.value.size for one in three}) > 1:
            continue
        table = np.column_stack([one.value for one in three])
        table = table[np.isfinite(table).all(axis=1)]
        if len(table) < len(free) or not _differ(table):
            continue
        # A loop that controls leaves an error that is smaller than what it controls.
        error = min(nameless, key=lambda one: float(np.nanstd(one.value)))
        one, other = (each for each in three if each is not error)
        if _is_set_point(one, other):
            return error, one, other
        return error, other, one
    return None


def _differ(table: Array) -> bool:
    """Whether one of three columns (n, 3) is the difference of the others, but for rounding."""
    least = float(np.min(np.std(table, axis=0)))
    # With either sign of each, the first is the sum of the others.
    left = (table[:, 0] - first * table[:, 1] - second * table[:, 2] for first, second in ((1, 1), (1, -1), (-1, 1)))
    return any(float(np.sqrt(np.mean(one**2))) < _ROUNDED * least for one in left)


def _is_set_point(one: TableColumn, other: TableColumn) -> bool:
    """Whether the other column follows this one: it moves towards it.

    The noise of neither shows in the sum: each of its changes is taken back by the error that it makes.
    """
    roles = one.by_name.role, other.by_name.role
    if roles[0] in SET_POINTS or roles[1] in MOTION:
        return True
    if roles[1] in SET_POINTS or roles[0] in MOTION:
        return False
    towards = 0.0
    for run in one.runs:
        error, change = (one.value - other.value)[run], np.diff(other.value[run])
        towards += float(np.nansum(change * (error[1:] + error[:-1])))
    return towards > 0.0
