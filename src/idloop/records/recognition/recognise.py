"""What the columns of a table are, each with the reason, and what is uncertain about it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from collections.abc import Mapping as Map
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.formats.known_columns import recognise as known_drive
from idloop.records.inspection.coupled import has_slack
from idloop.records.recognition.column_name import ColumnName, name_in, parse_column_name
from idloop.records.recognition.consistency import (
    doubt_of_lost_rows,
    doubt_of_names,
    doubt_of_removed_means,
    leave_out_unrelated,
    loop_beside_command,
    without_control_error,
)
from idloop.records.recognition.driven_motion import driven_most
from idloop.records.recognition.guess import (
    LOAD,
    MOTION,
    ROLES,
    SET_POINTS,
    Given,
    Guess,
    checked_formula,
    quoted,
    with_unit,
)
from idloop.records.recognition.joints import (
    in_blocks,
    joints_by_name,
    joints_by_side,
    joints_with_command,
    one_joint,
    rates_among_states,
)
from idloop.records.recognition.role_units import doubt_of_left_out, is_linear, set_units, set_wraps, unit_by_words
from idloop.records.recognition.roles import (
    AT_LOAD,
    AT_MOTOR,
    BY_UNIT,
    FIELD_WORDS,
    IN_OR_OUT,
    RoleByName,
    is_computed,
    is_force_sensor,
    is_of_hand,
    is_sensor_in_volts,
    is_torque,
    may_be_measured,
    may_be_supply,
    role_by_name,
    says_no_command,
)
from idloop.records.recognition.table_column import Choice, TableColumn, numbers_of, runs_of
from idloop.records.recognition.time_base import TimeBase, base_of_clock, doubt_of_decimation, find_time_base
from idloop.records.recognition.unnamed_columns import fill_by_values, find_set_point, follows, longest_way
from idloop.records.tables.base_units import COUNTS, base_unit, known_clock_unit
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.expression import Expression
from idloop.records.tables.mapping import Time
from idloop.records.tables.stamps import bad_stamps, in_order, missing_stamps, without_bad_stamps
from idloop.records.tables.table import Table
from idloop.spelling import listed

_NUMBER_IN_NAME = re.compile(r"(?P<before>[A-Za-z]*)[_\- ]?(?P<number>-?\d+(?:[.,]\d+)?)(?P<unit>[A-Za-z%]*)")
_DESIRED = re.compile(r"(.+)_d(\W?\d*\W?)")
_KNOWN_RANK = 10.0  # a known drive says more than a name
# Turns within which a position on a spring, or a weight that hangs, stays.
_TURNS_ON_A_SPRING = 2.0
_MULTIPLE = 0.999  # squared correlation of a torque with the current that it was computed from
_COMMAND_WORDS = {"V", "mV", "A", "mA", "%"}


@dataclass(frozen=True)
class Recognition:
    """What a table holds."""

    table: Table
    base: TimeBase
    guesses: tuple[Guess, ...]  # in the order of `ROLES`
    clocks: dict[str, Time] = field(default_factory=dict)  # stamps of a column of its own, by column
    rows: tuple[slice, ...] = ()  # records in the table: rows of each
    other: tuple[str, ...] = ()  # columns that are not used
    doubts: tuple[str, ...] = ()  # what is uncertain beside the columns
    sources: Map[str, Map[str, str]] = field(default_factory=dict)  # of a bag: how a mapping file names each column
    definitions: Map[str, str] = field(default_factory=dict)  # of a bag: message types that a mapping has to define
    joints: tuple[str, ...] = ()  # all that have a motion and a command or effort, where there are several

    def of(self, role: str) -> Guess | None:
        """Return the guess of one role."""
        return next((one for one in self.guesses if one.role == role), None)

    @property
    def runs(self) -> dict[str, dict[str, Any]]:
        """What each record is of the table, as a part of a mapping, by its name; the whole table has neither."""
        if self.table.parts:
            windows = self.table.parts.items()
            return {name: {"times": {"start": start, "stop": stop}} for name, (start, stop) in windows}
        if len(self.rows) <= 1 and (not self.rows or self.rows[0] == slice(0, self.base.seconds.size)):
            return {"": {}}
        return {f"run{k}": self._window(one) for k, one in enumerate(self.rows, 1)}

    @property
    def begin(self) -> float:
        """Where the record begins on the clock of the table [s]: at the first stamp of any signal that is used."""
        first = float(self.base.seconds[self.rows[0].start if self.rows else 0])
        clocks = {self.table.clocks[one.column] for one in self.guesses if one.column in self.table.clocks}
        return min([first, *(float(self.table.columns[name][0]) for name in clocks)]) if self.sources else first

    def _window(self, rows: slice) -> dict[str, Any]:
        """Rows of a table; where the columns have stamps of their own, the times of these rows of the motion."""
        if not self.table.clocks:
            return {"rows": {"start": rows.start, "stop": rows.stop}}
        seconds = self.base.seconds - (self.begin if self.sources else 0.0)
        edges = {"start": rows.start, "stop": rows.stop}
        return {"times": {name: float(seconds[row]) for name, row in edges.items() if row < seconds.size}}

    @property
    def linear(self) -> bool:
        """Whether the axis is a linear one."""
        return any(is_linear(one.unit) for one in self.guesses if one.role in MOTION)

    def all_doubts(self) -> list[str]:
        """Everything uncertain."""
        of_signals = (doubt for guess in self.guesses for doubt in guess.doubts)
        return [one for one in (self.base.doubt, *of_signals, *self.doubts) if one]


def recognise_table(
    table: Table,
    given: Map[str, Given] | None = None,
    *,
    period: float | None = None,
    sources: Map[str, Map[str, str]] | None = None,
    joints: Map[str, str] | None = None,
    shown: Map[str, Guess] | None = None,
) -> Recognition:
    """Find out what the columns of a table are.

    `given`: what the user says, by role; ``none`` as the column leaves the role out.
    `period`: sampling period [s], where there is no time column.
    `sources`: of a bag: how a mapping file names each column.
    `joints`: joint of each column, where the file says it.
    `shown`: what this table and others of the axis show together of columns whose names say nothing, by role.
    Raises InputError: no time, no command, or no motion is found, or what is given is not there.
    """
    given = dict(given or {})
    numbers = numbers_of(table)
    base = _begun_again(table, _without_bad_stamps(table, _time(table, numbers, given.get("time"), period)))
    log = Choice(table, base, given)
    several = _by_names(log, numbers, sources or {}, joints)
    chosen = log.chosen
    if shown is None:
        fill_by_values(log)
    else:
        chosen |= {role: guess for role, guess in shown.items() if guess.column in log.columns and role not in chosen}
    _output(log)
    find_set_point(log)
    _command_without_column(log)
    if not any(role in chosen for role in MOTION):
        raise InputError(
            f"{table.path}: {_no_motion(log)}; name one with --position or --velocity (columns are"
            f" {listed(numbers, 20)}){_of_a_sensor(log.columns.values())}"
        )
    if LOAD in chosen and "position" not in chosen:
        raise InputError(f"{table.path}: a load is beside the position of the axis: name that with --position COLUMN")
    set_units(log)
    base = log.base
    exchanged = doubt_of_names(log)
    unrelated = "" if exchanged else leave_out_unrelated(log)
    of_rows = (
        doubt_of_decimation(table, base),
        doubt_of_lost_rows(table, numbers, base),
        doubt_of_removed_means(log),
    )
    log.doubts += filter(None, (*of_rows, doubt_of_left_out(log), exchanged, unrelated))
    set_wraps(log)
    log.doubts += loop_beside_command(log)
    _set_point_command(log)
    guesses = tuple(chosen[role] for role in ROLES if role in chosen)
    used = {one.column for one in guesses} | set(base.columns)
    # What no clock says holds for all of them.
    clocks = {
        one.column: Time(column=clock, unit=known_clock_unit(table.units.get(clock, "")) or base.time.unit)
        for one in guesses
        if (clock := table.clocks.get(one.column)) is not None and clock != base.time.column
    }
    rows = () if table.clocks else tuple(base.runs)
    other = tuple(name for name in table.of_record if name not in used and name not in table.clocks.values())
    return Recognition(table, base, guesses, clocks, rows, other, tuple(log.doubts), sources or {}, joints=several)


def shown_together(tables: list[Table], given: Map[str, Given], *, period: float | None = None) -> dict[str, Guess]:
    """Find out what several tables of one axis show together of columns whose names say nothing.

    A command may be held through each of them, and a sensor may stand still in one. A table that cannot be read like
    the first one is left out.

    `tables`: with the same columns and one clock each.
    `given`, `period`: as in `recognise_table`.
    Returns: by role; empty where names say everything.
    """
    read: list[tuple[dict[str, Array], TimeBase]] = []
    for table in tables:
        try:
            numbers = numbers_of(table)
            base = _time(table, numbers, given.get("time"), period)
        except InputError:
            continue
        if not read or (base.time == read[0][1].time and numbers.keys() == read[0][0].keys()):
            read.append((numbers, base))
    if not read:
        return {}
    first, base = read[0]
    # From its own beginning the time of each starts again, as it does between the runs of one table.
    stamps = [in_order(one.seconds, bad_stamps(one.seconds)) - one.seconds[0] for _, one in read]
    numbers = {name: np.concatenate([one[name] for one, _ in read]) for name in first}
    together = replace(tables[0], columns=dict(numbers), clocks={})
    log = Choice(together, replace(base, seconds=np.concatenate(stamps)), given)
    _by_names(log, numbers, {}, None)
    by_names = set(log.chosen)
    fill_by_values(log)
    return {role: guess for role, guess in log.chosen.items() if role not in by_names}


def _by_names(
    log: Choice, numbers: dict[str, Array], sources: Map[str, Map[str, str]], joints: Map[str, str] | None
) -> tuple[str, ...]:
    """Fill the columns, and choose what is given or said by their names; return the joints where there are several."""
    table, base, columns = log.table, log.base, dict[str, TableColumn]()
    paths = joints_by_name(numbers) if joints is None else None
    joints = (joints or joints_by_side(numbers)) if paths is None else paths
    for name, value in numbers.items():
        if name in base.columns or name in table.clocks.values() or name in table.stamp_parts:
            continue
        parsed = _parsed(table, name)
        if joints is not None:
            parsed = replace(parsed, index=joints.get(name, ""))
        one = TableColumn(name, parsed, role_by_name(parsed), value, runs_of(value, base))
        columns[name] = one.as_other() if one.is_further_clock(base.seconds) else one
    for refine in (_input_and_output, _currents, _prefer_current, _computed, _hand):
        refine(columns)
    _of_known_drive(columns, sources)
    columns = {name: one.with_sign() for name, one in columns.items()}
    columns |= rates_among_states(columns, base.seconds)
    _supplies(columns)
    blocks, doubt = in_blocks(columns)
    every = columns | blocks
    log.doubts += [doubt] if doubt else []
    named = {one.column for role, one in log.given.items() if role != LOAD}
    of_axis = {name: one for name, one in every.items() if name != log.said(LOAD)}
    of_joint = one_joint(of_axis, named, log.doubts, command=log.said("command"), by_path=paths is not None)
    log.columns = without_control_error(of_joint, {one.column for one in log.given.values()})
    for role in ROLES:
        if log.left_out(role):
            continue
        guess = _given(log, role, numbers) if log.said(role) else _by_name(log, role)
        if guess is not None:
            log.chosen[role] = guess
            _add_column_of(log, guess, numbers)
    _load(log, every)
    return joints_with_command(every)


def _no_motion(log: Choice) -> str:
    """That there is no motion: what is named so never changes, or holds no values, or none is named."""
    still = [one.name for one in log.columns.values() if one.by_name.role in MOTION and not one.moves]
    if still:
        return f"nothing moves: {listed(still)} never changes"
    # A column of nothing but NaN is among no numbers.
    table = log.table
    named = [name for name in table.columns if role_by_name(name_in(table, name)).role in MOTION]
    empty = [name for name in named if name not in log.columns and not _values_in(table, name)]
    return (
        f"no motion was measured: {listed(empty)} {'holds' if len(empty) == 1 else 'hold'} no values"
        if empty
        else "no column is a position or a velocity"
    )


def _values_in(table: Table, name: str) -> bool:
    """Whether a column holds anything, be it text."""
    try:
        return bool(np.isfinite(table.numbers(name)).any())
    except InputError:
        return True


def _of_a_sensor(columns: Iterable[TableColumn]) -> str:
    """How a motion that a sensor shows in volts is said; empty where nothing is in volts."""
    known = list(columns)
    volts = [one for one in reversed(known) if one.parsed.unit in ("V", "mV")]
    volts.sort(key=lambda one: not is_sensor_in_volts(one.parsed))
    if any(one.by_name.role in MOTION for one in known):
        # The motion has a column of its own, which stands still: no other voltage shows it.
        volts = [one for one in volts if is_sensor_in_volts(one.parsed)]
    name = next((one.name for one in volts if not is_force_sensor(one.parsed)), "")
    return f"; that of a sensor in volts as a formula, such as --position '{quoted(name)} * 0.5=rad'" if name else ""


def _time(table: Table, numbers: dict[str, Array], given: Given | None, period: float | None) -> TimeBase:
    if table.clocks and period is None and (given is None or not given.column):
        # The motion's clock is the one that counts; of several the finest one.
        roles = {column: role_by_name(parse_column_name(column)).role for column in table.clocks if column in numbers}
        moving = [table.clocks[column] for column, role in roles.items() if role in MOTION]
        name = max(moving or table.clocks.values(), key=lambda clock: len(table.columns[clock]))
        return base_of_clock(table, name, known_clock_unit(table.units.get(name, "")), given.unit if given else "")
    count = max((value.size for value in numbers.values()), default=0)
    return find_time_base(table, numbers, given, count, period)


def _without_bad_stamps(table: Table, base: TimeBase) -> TimeBase:
    """Take the stamp before it for one that is wrong or missing; an import leaves its row out."""
    seconds = base.seconds
    for find in (missing_stamps, bad_stamps):
        seconds, _ = without_bad_stamps(seconds, find, table.first_row, table.notes)
    return replace(base, seconds=seconds)


def _begun_again(table: Table, base: TimeBase) -> TimeBase:
    """Let the stamps begin at zero with each record that the file keeps apart."""
    begins = np.array(table.begins, dtype=np.int64)
    if not begins.size:
        return base
    counts = np.diff(begins, append=base.seconds.size)
    return replace(base, seconds=base.seconds - np.repeat(base.seconds[begins], counts))


def _of_known_drive(columns: dict[str, TableColumn], sources: Map[str, Map[str, str]]) -> None:
    """Set role, unit and conversion of the columns of a drive whose logs are known."""
    fields = {name: sources.get(name, {}).get("field") or name for name in columns}
    device = known_drive(fields.values())
    if device is None:
        return
    known, order = device.known(fields.values()), list(device.columns.values())
    for name, own in fields.items():
        column, entry = columns[name], known.get(own)
        if entry is None or entry.role == "time":
            continue
        raw = column.value[np.isfinite(column.value)]
        # A log that was converted already holds no whole numbers.
        if (entry.decode is not None or entry.scale != 1.0) and (raw != np.round(raw)).any():
            continue
        options = entry.model_dump(include={"scale", "offset", "decode", "wrap"}, exclude_defaults=True)
        doubts = [f"{entry.role}: {entry.note}"] if entry.note else []
        if entry.divide_by:
            doubts.append(
                f"{name!r} counts by {entry.divide_by}, taken as 1: set its `scale:` in the mapping to"
                f" {entry.scale:.6g} divided by their number"
            )
        columns[name] = replace(
            column,
            parsed=replace(column.parsed, unit=entry.unit),
            # What stands first in the list of a drive's columns is meant before what has the same role.
            by_name=RoleByName(entry.role, _KNOWN_RANK - 0.01 * order.index(entry), f"a column of {device.device}"),
            options=options,
            doubts=tuple(doubts),
        )


def _parsed(table: Table, name: str) -> ColumnName:
    """Take a name apart; of two that differ by a d at the end that one was desired: tau_J_d[3] beside tau_J[3]."""
    parsed = name_in(table, name)
    match = _DESIRED.fullmatch(name)
    # Along the field of a motor d is a direction.
    if match is None or match[1] + match[2] not in table.columns or set(parsed.words) & FIELD_WORDS:
        return parsed
    return replace(parsed, words=("desired", *(word for word in parsed.words if word != "d")))


def _input_and_output(columns: dict[str, TableColumn]) -> None:
    """Take one of an input and an output for measured, where nothing else is a motion.

    The input of a controller, which is logged with a set-point, is measured; that of a plant is the command.
    """
    both = {one.parsed.words[0]: one for one in columns.values() if one.parsed.words in IN_OR_OUT}
    if len(both) < 2 or any(one.by_name.role in MOTION for one in columns.values()):
        return
    loop = any(one.by_name.role in SET_POINTS for one in columns.values())
    one = both["input" if loop else "output"]
    reason = "input of a controller" if loop else "output beside an input"
    columns[one.name] = replace(one, by_name=RoleByName("position", 2.0, reason))


def _currents(columns: dict[str, TableColumn]) -> None:
    """Take a current that no name calls a command for measured, where the set-point of a loop was recorded."""
    if not any(one.by_name.role in SET_POINTS and one.moves for one in columns.values()):
        return
    for one in columns.values():
        if one.by_name.role == "command" and may_be_measured(one.parsed):
            columns[one.name] = replace(one, by_name=replace(one.by_name, role="effort"))


def _prefer_current(columns: dict[str, TableColumn]) -> None:
    """Take a torque for measured, of which no name says that it was commanded, beside the current that makes it.

    A torque that is a multiple of the current was computed from it, and says more.
    """
    acting = [one for one in columns.values() if one.by_name.role == "command" and one.moves]
    for current in (one for one in acting if may_be_measured(one.parsed)):
        for torque in acting:
            alike = torque.parsed.index == current.parsed.index and torque.value.size == current.value.size
            if not (alike and is_torque(torque.parsed)) or _runs_with(torque.value, current.value):
                continue
            doubt = (
                f"command: {current.name!r} is taken, as the current makes the torque; if {torque.name!r} was commanded"
                f" and not measured, --command {shlex.quote(torque.name)}"
            )
            measured = RoleByName("effort", 1.0, f"{torque.by_name.reason}, beside a current")
            columns[torque.name] = replace(torque, by_name=measured, doubts=(*torque.doubts, doubt))


def _runs_with(value: Array, other: Array) -> bool:
    """Whether a column is a multiple of another one, but for rounding."""
    known = np.isfinite(value) & np.isfinite(other)
    if known.sum() < 2 or not (np.ptp(value[known]) and np.ptp(other[known])):
        return False
    return bool(np.corrcoef(value[known], other[known])[0, 1] ** 2 > _MULTIPLE)


def _computed(columns: dict[str, TableColumn]) -> None:
    """Take what a model gave for no signal of the axis, where the same was measured or commanded."""
    for roles in (("command", "effort"), *((role,) for role in MOTION)):
        alike = [one for one in columns.values() if one.by_name.role in roles]
        if any(one.moves and not is_computed(one.parsed) for one in alike):
            computed = (one for one in alike if is_computed(one.parsed))
            columns |= {one.name: one.as_other() for one in computed}


def _hand(columns: dict[str, TableColumn]) -> None:
    """Take the place of the hand of an arm for no signal of the axis where a joint was measured as well."""
    motions = [one for one in columns.values() if one.by_name.role in MOTION]
    if any(one.moves and not is_of_hand(one.parsed) for one in motions):
        columns |= {one.name: one.as_other() for one in motions if is_of_hand(one.parsed)}


def _supplies(columns: dict[str, TableColumn]) -> None:
    """Take a voltage that hardly varies for the supply, where its name says so or another column is a command."""
    commands = [one for one in columns.values() if one.by_name.role == "command"]
    for one in commands:
        others = any(other.moves for other in commands if other is not one)
        if one.steady and (may_be_supply(one.parsed) or (others and one.parsed.unit in ("V", "mV"))):
            columns[one.name] = replace(one, by_name=RoleByName("supply", 1.0, "a voltage that hardly varies"))


def _given(log: Choice, role: str, numbers: dict[str, Array]) -> Guess:
    table, said = log.table, log.given[role]
    if said.column in numbers:
        column = log.columns.get(said.column)
        if column is None:
            parsed = _parsed(table, said.column)
            column = TableColumn(said.column, parsed, role_by_name(parsed), numbers[said.column])
        return with_unit(column.as_guess(role, "as given", unit_given=bool(said.unit)), said.unit)
    if said.column in table.columns:
        raise InputError(f"{table.path}: column {said.column!r} holds no numbers; it cannot be the {role}")
    if is_number(said.column) and role not in MOTION:
        return with_unit(Guess(role, "", "", "as given", options={"value": float(said.column)}), said.unit)
    checked_formula(table, role, said, numbers)
    return with_unit(Guess(role, said.column, "", "as given", options={"compute": said.column}), said.unit)


def _add_column_of(log: Choice, guess: Guess, numbers: dict[str, Array]) -> None:
    """Add values of a guess that are among no columns yet: computed ones, and what the user has named."""
    if guess.column and guess.column not in log.columns:
        computed = "compute" in guess.options
        value = Expression(guess.column).evaluate(numbers) if computed else numbers[guess.column]
        runs = runs_of(value, log.base)
        log.columns[guess.column] = TableColumn(guess.column, ColumnName((), "", ""), RoleByName(""), value, runs)


def _by_name(log: Choice, role: str) -> Guess | None:
    """Return the column whose name says that it has the role, of several the surest one."""
    columns = log.columns
    taken = {one.column for one in log.chosen.values()} | {one.column for one in log.given.values()}
    free = [one for one in columns.values() if one.name not in taken and one.by_name.role == role]
    moving = [one for one in free if one.moves]
    if role in ("velocity", "effort"):
        free = moving
    elif role in SET_POINTS:
        # A set-point may be held; one at zero throughout was not in use.
        free = moving or [one for one in free if np.nan_to_num(one.value).any()]
    if not free:
        return None
    # Of motions whose names say as much, what has far fewer values is held or coarse, such as a set-point.
    best = max(moving or free, key=lambda one: (one.by_name.rank, one.decades if role in MOTION else 0))
    if role in MOTION and (other := _beside_another_motion(log, role, best, moving)) is not None:
        best = other
    # One motion in counts and in a unit is one signal.
    same = [one for one in moving if role in MOTION and one is not best and one.times(best)]
    if best.parsed.unit in ("", *COUNTS) and (known := [one for one in same if one.parsed.unit not in ("", *COUNTS)]):
        same = [best, *(one for one in same if one is not known[0])]
        best = known[0]
    guess = best.as_guess(role)
    if same:
        said = f"{guess.reason}; the same as {listed(one.name for one in same)} but for a factor"
        guess = replace(guess, reason=said)
    others = (one for one in moving if one is not best and one not in same)
    also = [one.name for one in others if one.by_name.rank > best.by_name.rank - 1.0]
    if role == "position":
        also = [name for name in also if not _slack_between(best, columns[name])]
    if role == "command" and best.by_name.reason == BY_UNIT:
        # A unit alone says little: what has no name may be meant.
        also += [one.name for one in columns.values() if one.name not in taken and one.moves and not one.by_name.role]
    if also and role in ("command", *MOTION):
        guess = guess.with_doubt(f"{role}: {listed(also)} could be meant as well: --{role} COLUMN")
    if role == "command" and (doubt := _doubt_of_command(best)):
        guess = guess.with_doubt(doubt)
    return with_unit(guess, log.given.get(role, Given()).unit)


def _beside_another_motion(log: Choice, role: str, best: TableColumn, moving: list[TableColumn]) -> TableColumn | None:
    """Return the motion that the command drives, or the velocity of that position, of those that are named as surely.

    A log of a cart and the pendulum on it has both, and one command.
    """
    rivals = {one.name: one for one in moving if one.by_name.rank == best.by_name.rank}
    if len(rivals) < 2:
        return None
    if role == "position":
        command = log.column("command")
        positions = {name: one.unwrapped(one.parsed.unit or "counts") for name, one in rivals.items()}
        return rivals.get(driven_most(positions, command.value, command.runs)) if command is not None else None
    place = log.column("position")
    slopes = {} if place is None else {name: log.slope(place, one) for name, one in rivals.items()}
    found = [(slope.correlation, name) for name, slope in slopes.items() if slope is not None]
    return rivals[max(found)[1]] if found else None


def _doubt_of_command(one: TableColumn) -> str:
    """Whether the column that is the command by its name may be the supply, unused, or measured."""
    if one.steady and (one.parsed.unit or unit_by_words(one.parsed)) in ("V", "mV"):
        return f"command: {one.name!r} hardly varies: if it is the supply, --supply '{one.name}' and --command COLUMN"
    if not np.nan_to_num(one.value).any():
        return f"command: {one.name!r} is zero throughout: if another is meant, --command COLUMN"
    if one.by_name.rank < _KNOWN_RANK - 1.0 and says_no_command(one.parsed):
        return (
            f"command: no name says that {one.name!r} was commanded: if it was measured, set"
            " `input: {kind: measured}` in the model file"
        )
    return ""


def _load(log: Choice, every: Map[str, TableColumn]) -> None:
    """Name the columns that may be the position of the load, behind a gear, belt or spring."""
    place = log.column("position")
    if place is None or log.said(LOAD):
        return
    # What has a command of its own is another axis, such as the other side of a vehicle.
    driven = {one.parsed.index for one in every.values() if one.by_name.role == "command" and one.moves}
    driven -= {place.parsed.index, ""}
    measured = [one for one in every.values() if one.by_name.role == "position" and one.name != place.name]
    measured = [one for one in measured if one.parsed.index not in driven]
    found = [one for one in measured if _slack_between(place, one)]
    if found:
        other, turned = found[0].name, AT_LOAD & set(place.parsed.words) or AT_MOTOR & set(found[0].parsed.words)
        both = f"--position {shlex.quote(other)} --load {shlex.quote(place.name)}"
        names = listed(one.name for one in found)
        doubt = (
            f"position: {names} {'runs' if len(found) == 1 else 'run'} with {place.name!r}, but for some"
            " slack: if one sensor is at the motor and one at the load, behind a gear, belt or spring, a model of two"
            f" bodies: {both if turned else f'--load {shlex.quote(other)}'}"
        )
        log.change("position", doubt)


def _slack_between(place: TableColumn, other: TableColumn) -> bool:
    value, beside = (one.unwrapped(one.parsed.unit or "counts") for one in (place, other))
    if value.size != beside.size:
        return False
    run = longest_way(value, place.runs)
    return has_slack(value[run], beside[run])


def _output(log: Choice) -> None:
    """Decide whether an output ``y`` is a position or a velocity, and doubt a position that runs as a velocity."""
    chosen, column = log.chosen, log.column("position")
    named = log.given.keys() & set(MOTION) or "velocity" in chosen
    if column is None or named or not chosen.keys() & {"command", "effort"} or is_linear(chosen["position"].unit):
        return
    unit, driven = chosen["position"].unit, log.column("command" if "command" in chosen else "effort")
    runs_so = driven is not None and not column.is_angle and follows(column.value, driven.value, column.runs)
    output = not unit and parse_column_name(column.name).words in (("y",), *IN_OR_OUT)
    turns = runs_so and _most_turns(column) > _TURNS_ON_A_SPRING
    if turns or (output and runs_so):
        del chosen["position"]
        kind = "a motion" if turns else "an output"
        reason = f"{kind} that is large where the command is{', over many turns' if turns else ''}"
        chosen["velocity"] = column.as_guess("velocity", reason)
    if turns or output:
        role = "velocity" if "velocity" in chosen else "position"
        either = " or ".join(f"--{one} {shlex.quote(column.name)}" for one in MOTION)
        log.change(role, f"{column.name!r} may be a position or a velocity: {either}")
    elif runs_so and not unit:
        doubt = (
            f"{column.name!r} is large where the command is, as a velocity is, and a position on a spring: if it"
            f" is one, --velocity {shlex.quote(column.name)}"
        )
        log.change("position", doubt)


def _most_turns(column: TableColumn) -> float:
    """Turns that a column goes through if it is an angle; in degrees without a unit, which are the fewest."""
    if column.parsed.unit in COUNTS:
        return 0.0
    turn = base_unit(column.parsed.unit or "deg", "position", column.name)[1] / base_unit("rev", "position", "")[1]
    return turn * float(np.nanmax(column.value) - np.nanmin(column.value))


def _command_without_column(log: Choice) -> None:
    """Find a command where no column is one: in the name of the file, or a measured force."""
    if "command" in log.chosen:
        return
    if log.left_out("command"):
        log.doubts.append("without a command nothing can be fitted to this record")
    elif (in_name := _in_file_name(log.table.path)) is not None:
        pattern, number, unit = in_name
        doubt = "the command is taken from the name of the file: --command VALUE=UNIT, or --command COLUMN"
        reason = f"{number:g} in the name of the file"
        log.chosen["command"] = Guess("command", "", unit, reason, (doubt,), {"file_name": pattern})
    elif (effort := log.chosen.pop("effort", None)) is not None:
        log.chosen["command"] = replace(effort, role="command").with_doubt(
            f"no command was recorded; the measured {effort.column!r} acts as the input"
        )


def _set_point_command(log: Choice) -> None:
    """Take a set-point for the command where nothing else is one; refuse where there is none.

    Beside a force that may be measured it is named.
    """
    role = next((role for role in SET_POINTS if role in log.chosen), None)
    command = log.chosen.get("command")
    if command is not None:
        measured = command.measured or says_no_command(parse_column_name(command.column))
        if role and measured and not log.said("command"):
            doubt = (
                "command: a set-point was recorded as well: for a model of the loop in the drive,"
                f" --command '{log.chosen[role].column}'"
            )
            log.change("command", doubt)
    elif log.left_out("command"):
        return
    elif role is None:
        stamps = {*log.base.columns, *log.table.clocks.values()}
        free = [name for name in log.table.columns if name not in stamps]
        raise InputError(
            f"{log.table.path}: no column is a command (force, torque, current, voltage, duty cycle, set-point); name"
            f" one of {listed(free, 20)} with --command COLUMN, give a constant with --command VALUE=UNIT, or leave"
            " it out with --command none"
        )
    else:
        taken = log.chosen.pop(role)
        log.chosen["command"] = replace(taken, role="command").with_doubt(
            f"command: no force, torque, current, voltage or duty cycle was recorded; the set-point {taken.column!r}"
            " is taken as the command of a loop in the drive: --command COLUMN if another column is the command"
        )


def _in_file_name(path: Path) -> tuple[str, float, str] | None:
    """Return pattern, number and unit of a command in the name of a file: ``pwm_60.csv``, ``step_12V.csv``."""
    for match in _NUMBER_IN_NAME.finditer(path.stem):
        before, unit = match["before"].lower(), match["unit"]
        if unit in _COMMAND_WORDS or before in {"pwm", "duty", "u", "volt", "voltage", "level", "cmd", "current"}:
            head = re.escape(match["before"]) if not unit else ""
            separator = r"[_\- ]?" if head else ""
            pattern = rf"{head}{separator}(-?\d+(?:[.,]\d+)?){re.escape(unit)}"
            return pattern, float(match["number"].replace(",", ".")), unit if unit in _COMMAND_WORDS else "-"
    return None
