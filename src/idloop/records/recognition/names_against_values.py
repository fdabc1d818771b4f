"""Names of columns that contradict their values: another column is the slope of another."""

from __future__ import annotations

from collections.abc import Mapping as Map

from idloop.records.inspection.velocity_check import velocity_slope
from idloop.records.recognition.guess import MOTION, Given, Guess
from idloop.records.recognition.role_units import base_field
from idloop.records.recognition.signal_units import slope_of
from idloop.records.recognition.smoothness import smoothest_first
from idloop.records.recognition.table_column import TableColumn
from idloop.records.recognition.time_base import TimeBase
from idloop.records.recognition.unnamed_columns import longest_way
from idloop.records.tables.base_units import COUNTS, is_unit_of

# What a swapped name may stand at: not at a set-point, whose slope is often logged beside it.
_MAY_BE = ("command", "effort", *MOTION, "other", "")
_MOST_COMPARED = 8


def doubt_of_names(
    base: TimeBase, chosen: Map[str, Guess], columns: Map[str, TableColumn], given: Map[str, Given]
) -> str:
    """Name the options of the signals whose values have to do with each other what their names say of others.

    A velocity is the slope of its position. Where that of the header is not, and one other column is that of another,
    which is smoother than all of them as a position is, the names are probably exchanged. A velocity exchanged with the
    command shows nothing: in friction a force runs with the speed as well.

    Returns: empty where the names hold, or nothing shows more.
    """
    place, speed = (columns.get(chosen[role].column) if role in chosen else None for role in MOTION)
    if place is None or speed is None or given.keys() & {*MOTION, "command"} or _slope(base, place, speed):
        return ""
    command = columns.get(chosen["command"].column) if "command" in chosen else None
    free = [one for one in columns.values() if one.by_name.role in _MAY_BE and one.moves]
    named = [one for one in (place, speed, command) if one is not None]
    free = [*named, *(one for one in free if one not in named)][:_MOST_COMPARED]
    free = [one for one in free if one.value.size == base.seconds.size]
    pairs = [
        (correlation, one, other)
        for one in free
        for other in free
        if one is not other and not (one is place and other.by_name.role in ("command", "effort"))
        if (correlation := _slope(base, one, other))
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
    flags = " ".join(f"--{role} '{one.name}{_unit(one, chosen[role], columns, named)}'" for role, one in taken.items())
    return (
        f"{speed.name!r} is not the slope of {place.name!r}, but {second.name!r} is that of {first.name!r}: the names"
        f" may be exchanged; if they are, {flags}"
    )


def leave_out_unrelated(
    base: TimeBase, chosen: dict[str, Guess], columns: Map[str, TableColumn], given: Map[str, Given]
) -> str:
    """Take no column for the velocity that is unrelated to the slope of the position, and say so.

    Where the command is that slope, the two may be exchanged, which an inspection tells.

    Returns: empty where the velocity is left, such as one that the user names.
    """
    place, speed, command = (
        columns.get(chosen[role].column) if role in chosen else None for role in (*MOTION, "command")
    )
    if place is None or speed is None or given.get("velocity", Given()).column:
        return ""
    if not place.value.size == speed.value.size == base.seconds.size:
        return ""
    value = place.unwrapped(place.parsed.unit or "counts")
    run = longest_way(value, place.runs)
    found = velocity_slope(base.seconds[run], value[run], speed.value[run])
    if found is None or not found.unrelated or (command is not None and _slope(base, place, command)):
        return ""
    del chosen["velocity"]
    return (
        f"velocity: {speed.name!r} is unrelated to the slope of {place.name!r} and not taken: --velocity COLUMN if it"
        " is the velocity, or --position COLUMN if another column is the position"
    )


def _unit(one: TableColumn, guess: Guess, columns: Map[str, TableColumn], named: list[TableColumn]) -> str:
    """Return what stands behind a column so that it is read in the unit that the header writes for its new role.

    `one`: what the role is to be.
    `guess`: what the role is by the header.
    `named`: all that have a role by the header: the units of their names are exchanged as the names are.
    Returns: such as ``=rad``; empty where its own name leads to that unit.
    """
    own, written = one.parsed, columns[guess.column].parsed
    if (own.unit, own.factor) == (written.unit, written.factor):
        return ""
    if one not in named and (not own.unit or is_unit_of(own.unit, base_field(guess.role))):
        return ""
    if written.unit in COUNTS:
        return "=counts/N"
    unit = written.unit or guess.unit
    return f"={unit}" if written.factor == 1.0 else f"={written.factor:g} {unit}"


def _slope(base: TimeBase, place: TableColumn, rate: TableColumn) -> float:
    """Correlation of a column with the slope of another; 0 where it runs otherwise."""
    if not place.value.size == rate.value.size == base.seconds.size:
        return 0.0
    found = slope_of(base.seconds, place.unwrapped(place.parsed.unit or "counts"), rate.value, place.runs)
    return 0.0 if found is None else found.correlation
