"""Tables without names that hold the joints of an arm in blocks: all positions, all velocities, all forces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from idloop.arrays import Array
from idloop.records.recognition.guess import MOTION
from idloop.records.recognition.roles import RoleByName, Signal
from idloop.records.recognition.table_column import TableColumn

_BLOCKS = 200  # means along which the slope of a motion is taken
_RUNS_WITH = 0.9  # correlation of a velocity with the slope of its position
_AT_REST = 0.05  # travel of a joint beside that of the farthest, which shows nothing of its velocity
_SAME = 0.1  # of the spread of a column, by which one that runs with it differs
_FEWEST_JOINTS, _MOST_COLUMNS = 2, 64


def slopes_and_means(values: Sequence[Array], runs: Iterable[slice]) -> tuple[Array, Array]:
    """Slopes of columns between means over blocks of rows, and the means between them, each shape (m, columns)."""
    slopes, between = [np.zeros((0, len(values)))], [np.zeros((0, len(values)))]
    for run in runs:
        table = np.column_stack([one[run] for one in values])
        length = max(1, len(table) // _BLOCKS)
        means = table[: len(table) // length * length].reshape(-1, length, len(values)).mean(axis=1)
        slopes.append((means[2:] - means[:-2]) / length)
        between.append(means[1:-1])
    return np.concatenate(slopes), np.concatenate(between)


def in_blocks(columns: dict[str, TableColumn]) -> tuple[dict[str, TableColumn], str]:
    """Name the columns of joints that lie in blocks: a velocity is as many columns behind its position as joints are.

    Returns: the columns that are named so, and what is doubted; nothing where a name says what moves, or none do so.
    """
    free = [one for one in columns.values() if not one.by_name.role]
    if any(one.by_name.role in (*MOTION, "command") for one in columns.values()):
        return {}, ""
    if not 3 * _FEWEST_JOINTS <= len(free) <= _MOST_COLUMNS or len({one.value.size for one in free}) > 1:
        return {}, ""
    runs_with = _correlations(free)
    travel = np.array([float(np.ptp(one.value[np.isfinite(one.value)])) for one in free])
    found = max(_pairs(runs_with, travel), default=None)
    if found is None:
        return {}, ""
    *_, before, count = found
    first = -before
    # A set-point and what follows it are no two joints.
    if count == _FEWEST_JOINTS and run_together(free[first].value, free[first + 1].value):
        return {}, ""
    forces = _forces(free, runs_with, first, count)
    blocks: dict[Signal, int] = {"position": first, "velocity": first + count}
    blocks |= {} if forces is None else {"command": forces}
    named = {
        one.name: replace(
            one,
            parsed=replace(one.parsed, index=str(joint + 1)),
            by_name=RoleByName(role, 1.0, f"the {role} of joint {joint + 1} in blocks of {count} columns"),
        )
        for role, begin in blocks.items()
        for joint, one in enumerate(free[begin : begin + count])
    }
    said = ", ".join(f"{role} {free[k].name!r} to {free[k + count - 1].name!r}" for role, k in blocks.items())
    return named, f"no name says what the columns are: they are taken as those of {count} joints, {said}"


def _correlations(free: list[TableColumn]) -> Array:
    """Correlation of the slope of each column (rows) with each column, 0 where one stands still."""
    slopes, means = slopes_and_means([one.value for one in free], free[0].runs)
    good = np.isfinite(slopes).all(axis=1) & np.isfinite(means).all(axis=1)
    slopes, means = (one[good] - one[good].mean(axis=0) if good.any() else one[:0] for one in (slopes, means))
    sizes = np.outer(np.sqrt((slopes**2).sum(axis=0)), np.sqrt((means**2).sum(axis=0)))
    return np.asarray(np.divide(slopes.T @ means, sizes, out=np.zeros_like(sizes), where=sizes > 0.0))


def _pairs(runs_with: Array, travel: Array) -> Iterable[tuple[int, bool, int, int]]:
    """Yield how many joints show, whether whole blocks lie before them, where they begin, negative, and how many are.

    Accelerations are the slopes of velocities as well, and forces may seem to be: the first pair of blocks counts.
    """
    for count in range(_FEWEST_JOINTS, len(travel) // 2 + 1):
        for first in range(len(travel) - 2 * count + 1):
            place = np.arange(first, first + count)
            shows = runs_with[place, place + count] > _RUNS_WITH
            rests = travel[place] < _AT_REST * travel[place].max(initial=0.0)
            if shows.sum() >= _FEWEST_JOINTS and (shows | rests).all():
                yield int(shows.sum()), first % count == 0, -first, count


def _forces(free: list[TableColumn], runs_with: Array, first: int, count: int) -> int | None:
    """Return where the block begins that is neither set-points nor accelerations; those behind the motions first."""
    behind = range(first + 2 * count, len(free) - count + 1, count)
    for begin in chain(behind, range(first - count, -1, -count)):
        shown = [k for k in range(count) if runs_with[first + k, first + count + k] > _RUNS_WITH]
        moves = [k for k in shown if free[begin + k].moves]
        # An acceleration is the slope of a velocity, a set-point runs with the position: so it is in all joints.
        slopes = [runs_with[first + count + k, begin + k] > _RUNS_WITH for k in moves]
        copies = [run_together(free[first + k].value, free[begin + k].value) for k in moves]
        if moves and not all(slopes) and not all(copies):
            return begin
    return None


def run_together(one: Array, other: Array) -> bool:
    """Whether two columns have nearly the same values."""
    if one.size != other.size:
        return False
    known = np.isfinite(one) & np.isfinite(other)
    return bool(known.any()) and float(np.std((one - other)[known])) < _SAME * float(np.std(one[known]))
