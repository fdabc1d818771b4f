"""What contradicts itself in a log: lost rows, a control error, exchanged names, a loop beside the command."""

from __future__ import annotations

from collections.abc import Container
from collections.abc import Mapping as Map
from dataclasses import replace
from itertools import combinations

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.velocity_check import velocity_slope
from idloop.records.recognition.column_name import is_counter, name_in
from idloop.records.recognition.guess import MOTION, SET_POINTS, quoted
from idloop.records.recognition.role_units import base_field
from idloop.records.recognition.roles import RoleByName, Signal, is_feed_forward
from idloop.records.recognition.table_column import Choice, TableColumn
from idloop.records.recognition.time_base import TimeBase
from idloop.records.recognition.unnamed_columns import follows, longest_way, smoothest_first
from idloop.records.tables.base_units import COUNTS, is_unit_of
from idloop.records.tables.table import Table
from idloop.spelling import joined_names, listed

# Share of the rows in which a counter rises by one number, and steps of the stamps that are usual, in their median.
_COUNTS, _USUAL = 0.9, 1.5
_FEWEST_ROWS = 10
_MAY_DIFFER = ("", *MOTION, *SET_POINTS)  # roles of two columns whose difference a control error may be
_ROUNDED = 0.01  # of the spread of each of three columns, by which rounding may leave their difference
_MOST_COMPARED = 20
# What a swapped name may stand at: not at a set-point, whose slope is often logged beside it.
_MAY_BE = ("command", "effort", *MOTION, "other", "")
_MOST_NAMED = 8
# Means that were removed: of so many samples and signals at least, below this share of the range, which does not lie
# alike on both sides of zero.
_FEWEST_FOR_MEAN, _SIGNALS, _NO_MEAN, _ONE_SIDED = 100, 2, 1e-6, 0.05
_GAINS = (("kp", "position", "reference"), ("kd", "velocity", "reference velocity"))


def doubt_of_lost_rows(table: Table, numbers: Map[str, Array], base: TimeBase) -> str:
    """Name the rows before which a counter leaves out numbers and the stamps do not, with the time by the counter."""
    step = np.diff(base.seconds)
    if base.seconds.size < _FEWEST_ROWS or len(base.runs) > 1 or not float(np.median(step)) > 0.0:
        return ""
    for name, value in numbers.items():
        counter = is_counter(name_in(table, name))
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


def without_control_error(columns: dict[str, TableColumn], given: Container[str]) -> dict[str, TableColumn]:
    """Return the columns with the roles that a control error among them shows, where neither name nor user says them.

    It is the difference of a set-point and a motion: neither the command nor a motion itself.
    """
    found = _found([one for one in columns.values() if one.name not in given])
    if found is None:
        return columns
    error, set_point, moved = found
    differ = f"the difference of {set_point.name!r} and {moved.name!r}"
    made = {error.name: error.as_other()}
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


def doubt_of_names(log: Choice) -> str:
    """Name the options of the signals whose values have to do with each other what their names say of others.

    A velocity is the slope of its position. Where that of the header is not, and one other column is that of another,
    which is smoother than all of them as a position is, the names are probably exchanged. A velocity exchanged with the
    command shows nothing: in friction a force runs with the speed as well.
    """
    place, speed, command = (log.column(role) for role in (*MOTION, "command"))
    if place is None or speed is None or log.given.keys() & {*MOTION, "command"} or log.slope(place, speed):
        return ""
    named = [one for one in (place, speed, command) if one is not None]
    free = [one for one in log.columns.values() if one.by_name.role in _MAY_BE and one.moves and one not in named]
    free = [*named, *free][:_MOST_NAMED]
    pairs = [
        (slope.correlation, one, other)
        for one in free
        for other in free
        if one is not other and not (one is place and other.by_name.role in ("command", "effort"))
        if (slope := log.slope(one, other)) is not None
    ]
    if not pairs:
        return ""
    _, first, second = max(pairs, key=lambda pair: pair[0])
    four = [one for one in {each.name: each for each in (first, second, place, speed)}.values() if one.moves]
    if smoothest_first([(one.value, one.runs) for one in four])[0] != 0:
        return ""
    taken = {"position": first, "velocity": second}
    left = [one for one in named if one is not first and one is not second]
    if command is not None and command not in left and left:
        taken["command"] = left[0]
    flags = " ".join(f"--{role} '{one.name}{_unit(log, role, one, named)}'" for role, one in taken.items())
    return (
        f"{speed.name!r} is not the slope of {place.name!r}, but {second.name!r} is that of {first.name!r}: the names"
        f" may be exchanged; if they are, {flags}"
    )


def leave_out_unrelated(log: Choice) -> str:
    """Take no column for the velocity that is unrelated to the slope of the position, and say so.

    Where the command is that slope, the two may be exchanged, which an inspection tells.
    """
    place, speed, command = (log.column(role) for role in (*MOTION, "command"))
    if place is None or speed is None or log.said("velocity"):
        return ""
    seconds = log.base.seconds
    if not place.value.size == speed.value.size == seconds.size:
        return ""
    value = place.unwrapped(place.parsed.unit or "counts")
    run = longest_way(value, place.runs)
    found = velocity_slope(seconds[run], value[run], speed.value[run])
    if found is None or not found.unrelated or (command is not None and log.slope(place, command)):
        return ""
    del log.chosen["velocity"]
    return (
        f"velocity: {speed.name!r} is unrelated to the slope of {place.name!r} and not taken: --velocity COLUMN if it"
        " is the velocity, or --position COLUMN if another column is the position"
    )


def _unit(log: Choice, role: str, one: TableColumn, named: list[TableColumn]) -> str:
    """What stands behind a column for the unit that the header writes for its new role, such as ``=rad``.

    The units of the names in `named` are exchanged as the names are; empty where its own name leads to that unit.
    """
    guess = log.chosen[role]
    own, written = one.parsed, log.columns[guess.column].parsed
    if (own.unit, own.factor) == (written.unit, written.factor):
        return ""
    if one not in named and (not own.unit or is_unit_of(own.unit, base_field(role))):
        return ""
    if written.unit in COUNTS:
        return "=counts/N"
    unit = written.unit or guess.unit
    return f"={unit}" if written.factor == 1.0 else f"={written.factor:g} {unit}"


def loop_beside_command(log: Choice) -> list[str]:
    """Return the option with the force of a drive that adds a loop to what it was sent, none where no loop acted.

    Its gains are logged beside its set-points, as in the protocol of the MIT mini cheetah: the drive makes
    ``kp (p_des - p) + kd (v_des - v) + t_ff``.
    """
    command = log.chosen.get("command")
    if command is None or log.said("command"):
        return []
    columns = log.columns.values()
    terms = []
    for name, motion, wanted in _GAINS:
        gain = next((one for one in columns if one.parsed.words == (name,)), None)
        measured = log.chosen.get(motion)
        if gain is None or measured is None or not np.nan_to_num(gain.value).any():
            continue
        if set(measured.options) - {"scale"}:
            return []
        target = next((one for one in columns if one.by_name.role == wanted), None)
        error = f"{quoted(target.name)} - " if target is not None else "-"
        terms.append(f"{quoted(gain.name)} * ({error}{quoted(measured.column)})")
    if not terms:
        return []
    fed = next((one for one in columns if is_feed_forward(one.parsed)), None)
    terms += [quoted(fed.name)] if fed is not None and np.nan_to_num(fed.value).any() else []
    text = "command: the gains of a loop in the drive are on record, which adds to what was sent; as one command:"
    return [f"{text} --command '{' + '.join(terms)}={command.unit or 'UNIT'}'"]


def doubt_of_removed_means(log: Choice) -> str:
    """Whether the means of command and motion were removed, as `detrend` of MATLAB does before a linear fit.

    No measured mean is zero to so many digits; only a signal as large on both sides of zero may have such a one.
    """
    used = [column for role in ("command", *MOTION) if (column := log.column(role)) is not None]
    values = [one.value[np.isfinite(one.value)] for one in used]
    values = [value for value in values if value.size > _FEWEST_FOR_MEAN and np.ptp(value) > 0.0]
    if len(values) < _SIGNALS or not all(abs(value.mean()) < _NO_MEAN * np.ptp(value) for value in values):
        return ""
    if all(abs(float(value.max() + value.min())) < _ONE_SIDED * np.ptp(value) for value in values):
        return ""
    names = joined_names([repr(one.name) for one in used])
    return (
        f"the means of {names} are zero to the last digit: they were removed before the log was saved, and with them"
        " what friction, a weight and an offset do; take the log as it was recorded, if there is one"
    )
