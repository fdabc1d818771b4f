"""What the columns of a table are, each with the reason, and what is uncertain about it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from collections.abc import Mapping as Map
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.formats.clock_names import known_clock_unit
from idloop.records.formats.known_columns import recognise as known_drive
from idloop.records.inspection.motion import white_noise
from idloop.records.recognition.column_name import WANTED, ColumnName, parse_column_name, unknown_unit
from idloop.records.recognition.guess import Given, Guess
from idloop.records.recognition.roles import BY_UNIT, CURRENTS, RoleByName, may_be_measured, may_be_supply, role_by_name
from idloop.records.recognition.signal_units import (
    find_decoding,
    find_wrap,
    motion_units,
    near_unit,
    slope_of,
    usual_resolution,
)
from idloop.records.recognition.smoothness import change_by_noise, smoothest_first
from idloop.records.recognition.time_base import TimeBase, base_of_clock, counts_rows, find_time_base
from idloop.records.tables.base_units import SECONDS, base_unit, known_unit
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.expression import Expression
from idloop.records.tables.mapping import Time
from idloop.records.tables.stamps import bad_stamps, in_order, note_bad_stamps
from idloop.records.tables.table import Table
from idloop.spelling import did_you_mean, listed

Floats = NDArray[np.float64]

MOTION = ("position", "velocity")
# Roles that may stand in a mapping file, in its order.
ROLES = ("command", "position", "velocity", "effort", "reference", "reference velocity", "temperature", "supply")
NONE = "none"
_LINEAR_WORDS = {"x", "stage", "slide", "carriage", "stroke", "displacement", "distance", "weg", "z", "height", "cart"}
_LINEAR_FORCES = {"N", "mN", "kN", "kip", "lbf"}
_LINEAR_UNITS = {"m", "cm", "mm", "um", "in", "m/s", "cm/s", "mm/s", "um/s", "m/min", "mm/min", "in/s"}
_NUMBER_IN_NAME = re.compile(r"(?P<before>[A-Za-z]*)[_\- ]?(?P<number>-?\d+(?:[.,]\d+)?)(?P<unit>[A-Za-z%]*)")
_IN_HERTZ = re.compile(r"[\[(_ ]hz[\])]?$", re.IGNORECASE)
_KNOWN_RANK = 10.0  # a known drive says more than a name
_LINE = 1e-3  # of the spread of a column, by which one that runs with the time or the rows leaves a straight line
_MOST_BY_LOOKS = 3  # columns without a name that are recognised by their values alone
_MOST_COMPARED = 20  # columns without a name that are held against the slope of the position
_ENCODERS = {"enc", "encoder", "count", "counts", "tick", "ticks", "inc"}
_FEWEST_COUNTS = 200  # of a turn
_MANY_COUNTS = 1000  # whole numbers as large as this are no angle in rad
_STEADY = 0.1  # of its mean, for a supply
_BLOCKS, _FEWEST_BLOCKS = 4000, 4  # means along which the path of a joint is measured
_FOLLOWS = 0.6  # correlation of a velocity with the command
_COMMAND_WORDS = {"V", "mV", "A", "mA", "%"}
# Names of units by the word that a column of the command has.
_UNITS_OF_WORDS = (
    ({"voltage", "volt", "volts", "vin", "spannung"}, "V"),
    (CURRENTS, "A"),
    ({"torque", "tau", "moment", "drehmoment", "effort", "efforts"}, "N·m"),
    ({"force", "kraft"}, "N"),
)


@dataclass(frozen=True)
class Recognition:
    """What a table holds.

    Attributes
    ----------
    table : Table
    base : TimeBase
    guesses : tuple of Guess
        In the order of `ROLES`.
    clocks : dict of str to Time
        Stamps of a column of its own, by column.
    rows : tuple of slice
        Records in the table: rows of each.
    other : tuple of str
        Columns that are not used.
    doubts : tuple of str
        What is uncertain beside the columns.
    sources : mapping of str to mapping
        Of a bag: how a mapping file names each column.
    definitions : mapping of str to str
        Of a bag: message types that a mapping has to define.
    """

    table: Table
    base: TimeBase
    guesses: tuple[Guess, ...]
    clocks: dict[str, Time] = field(default_factory=dict)
    rows: tuple[slice, ...] = ()
    other: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    sources: Map[str, Map[str, str]] = field(default_factory=dict)
    definitions: Map[str, str] = field(default_factory=dict)

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
        return {f"run{k}": {"rows": {"start": one.start, "stop": one.stop}} for k, one in enumerate(self.rows, 1)}

    @property
    def linear(self) -> bool:
        """Whether the axis is a linear one."""
        return any(one.unit in _LINEAR_UNITS for one in self.guesses if one.role in MOTION)

    def all_doubts(self) -> list[str]:
        """Everything uncertain."""
        return [one for one in (self.base.doubt, *(guess.doubt for guess in self.guesses), *self.doubts) if one]


@dataclass(frozen=True)
class _Column:
    """One column of numbers."""

    name: str
    parsed: ColumnName
    by_name: RoleByName
    value: Floats
    runs: tuple[slice, ...] = (slice(None),)
    options: dict[str, Any] = field(default_factory=dict)
    doubt: str = ""

    def as_guess(self, role: str) -> Guess:
        """What it is in this role, by its name or by the drive whose log it is of."""
        by_name, unit = self.by_name, self.parsed.unit
        if unit == "%" and role in (*MOTION, "reference", "reference velocity"):
            unit = ""  # of what, nothing says
        measured = by_name.role == "effort"
        return Guess(role, self.name, unit, by_name.reason, self.doubt, dict(self.options), measured)

    @property
    def moves(self) -> bool:
        known = self.value[np.isfinite(self.value)]
        return bool(known.size > 1 and float(np.ptp(known)) > 0.0)

    @property
    def steady(self) -> bool:
        """Whether it is above zero and hardly varies, as a supply voltage."""
        return float(np.nanstd(self.value)) < _STEADY * float(np.nanmean(self.value))

    @property
    def is_held(self) -> bool:
        """Whether it is constant in each of several runs."""
        return len(self.runs) > 1 and all(float(np.ptp(self.value[run])) == 0.0 for run in self.runs)

    def wrap(self, unit: str) -> float:
        """Range after which it starts again within a run, in its unit; 0 where it does not."""
        return max(find_wrap(self.value[run], unit) for run in self.runs)

    def unwrapped(self, unit: str) -> Floats:
        """Its values without the jumps where it starts again."""
        value, whole = self.value.copy(), self.wrap(unit)
        known = np.isfinite(value)
        if whole:
            value[known] = np.unwrap(value[known], period=whole)
        return np.asarray(value)

    def is_further_clock(self, seconds: Floats) -> bool:
        """Whether it is one more clock or counter: on a line over the stamps or the rows, with no name against that.

        A motion at one speed from the first row to the last would show nothing either.
        """
        if self.by_name.role in ("", "position") and not self.parsed.unit and counts_rows(self.value):
            return True
        if self.by_name.role or not self.moves or self.value.size != seconds.size:
            return False
        # A value that is not finite leaves no correlation.
        along = np.corrcoef([self.value, seconds, np.arange(seconds.size)])[0, 1:]
        return bool((1.0 - along**2 < _LINE**2).any())


def numbers_of(table: Table) -> dict[str, Floats]:
    """Columns that hold numbers."""
    found = {}
    for name in table.columns:
        try:
            value = table.numbers(name)
        except InputError:
            continue
        # What is infinite was not measured; an import says so.
        if np.isfinite(value).sum() > 1:
            found[name] = np.where(np.isfinite(value), value, np.nan)
    return found


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

    Parameters
    ----------
    table : Table
    given : mapping of str to Given
        What the user says, by role; ``none`` as the column leaves the role out.
    period : float, optional
        Sampling period [s], where there is no time column.
    sources : mapping of str to mapping, optional
        Of a bag: how a mapping file names each column.
    joints : mapping of str to str, optional
        Joint of each column, where the file says it.
    shown : mapping of str to Guess, optional
        What this table and others of the axis show together of columns whose names say nothing, by role.

    Raises
    ------
    InputError
        No time, no command, or no motion is found, or what is given is not there.
    """
    given = dict(given or {})
    numbers = numbers_of(table)
    doubts: list[str] = []
    base = _begun_again(table, _without_bad_stamps(table, _time(table, numbers, given.get("time"), period)))
    columns, chosen = _by_names(table, numbers, base, given, doubts, sources or {}, joints)
    if shown is None:
        _by_data(base, columns, chosen, given)
    else:
        chosen = {role: guess for role, guess in shown.items() if guess.column in columns} | chosen
    _set_point(columns, chosen, given)
    _no_command(table, base, chosen, given, doubts)
    if not any(role in chosen for role in MOTION):
        raise InputError(
            f"{table.path}: no column is a position or a velocity; name one with --position or --velocity (columns are"
            f" {listed(numbers, 20)}){_of_a_sensor(columns.values())}"
        )
    base = _units(base, chosen, columns, given)
    _decode(chosen, columns, given)
    guesses = tuple(chosen[role] for role in ROLES if role in chosen)
    used = {one.column for one in guesses} | {str(base.time.column)}
    clocks = {
        one.column: Time(
            column=table.clocks[one.column],
            # What no clock says holds for all of them.
            unit=known_clock_unit(table.units.get(table.clocks[one.column], "")) or base.time.unit,
        )
        for one in guesses
        if one.column in table.clocks and table.clocks[one.column] != base.time.column
    }
    rows = () if table.clocks else tuple(base.runs)
    other = tuple(name for name in table.columns if name not in used and name not in table.clocks.values())
    return Recognition(table, base, guesses, clocks, rows, other, tuple(doubts), sources or {})


def shown_together(tables: list[Table], given: Map[str, Given], *, period: float | None = None) -> dict[str, Guess]:
    """Find out what several tables of one axis show together of columns whose names say nothing.

    A command may be held through each of them, and a sensor may stand still in one. A table that cannot be read like
    the first one is left out.

    Parameters
    ----------
    tables : list of Table
        With the same columns and one clock each.
    given, period
        As in `recognise_table`.

    Returns
    -------
    dict of str to Guess
        By role; empty where names say everything.
    """
    read: list[tuple[dict[str, Floats], TimeBase]] = []
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
    base = replace(base, seconds=np.concatenate(stamps))
    numbers = {name: np.concatenate([one[name] for one, _ in read]) for name in first}
    together = replace(tables[0], columns=dict(numbers), clocks={})
    columns, by_names = _by_names(together, numbers, base, given, [], {}, None)
    chosen = dict(by_names)
    _by_data(base, columns, chosen, given)
    return {role: guess for role, guess in chosen.items() if role not in by_names}


def _by_names(
    table: Table,
    numbers: dict[str, Floats],
    base: TimeBase,
    given: Map[str, Given],
    doubts: list[str],
    sources: Map[str, Map[str, str]],
    joints: Map[str, str] | None,
) -> tuple[dict[str, _Column], dict[str, Guess]]:
    """Return the columns, and what is given of them or said by their names."""
    columns = {}
    for name, value in numbers.items():
        parsed = parse_column_name(name, table.units.get(name, ""))
        if name == base.time.column or name in table.clocks.values():
            continue
        if joints is not None:
            parsed = replace(parsed, index=joints.get(name, ""))
        one = _Column(name, parsed, role_by_name(parsed), value, _runs_of(value, base))
        further = one.is_further_clock(base.seconds)
        columns[name] = replace(one, by_name=RoleByName("other", 0.0, "")) if further else one
    _currents(columns)
    _of_known_drive(columns, sources)
    _supplies(columns)
    named = {one.column for one in given.values()}
    columns = _one_joint(columns, named, doubts)
    chosen: dict[str, Guess] = {}
    for role in ROLES:
        said = given.get(role, Given())
        if said.column == NONE:
            continue
        guess = _given(table, role, said, numbers) if said.column else _by_name(role, columns, chosen, given)
        if guess is not None:
            chosen[role] = guess
            columns |= _columns_of(guess, columns, numbers, base)
    _output(columns, chosen, given)
    return columns, chosen


def _of_a_sensor(columns: Iterable[_Column]) -> str:
    """How a motion that a sensor shows in volts is said; empty where nothing is in volts."""
    name = next((one.name for one in reversed(list(columns)) if one.parsed.unit in ("V", "mV")), "")
    return f"; that of a sensor in volts as a formula, such as --position '{_quoted(name)} * 0.5=rad'" if name else ""


def _quoted(name: str) -> str:
    """Name of a column as a formula has it."""
    return name if name.isidentifier() else f"`{name}`"


def _time(table: Table, numbers: dict[str, Floats], given: Given | None, period: float | None) -> TimeBase:
    if table.clocks and period is None and (given is None or not given.column):
        # The motion's clock is the one that counts; of several the finest one.
        roles = {column: role_by_name(parse_column_name(column)).role for column in table.clocks if column in numbers}
        moving = [table.clocks[column] for column, role in roles.items() if role in MOTION]
        name = max(moving or table.clocks.values(), key=lambda clock: len(table.columns[clock]))
        return base_of_clock(table, name, known_clock_unit(table.units.get(name, "")), given.unit if given else "")
    count = max((value.size for value in numbers.values()), default=0)
    return find_time_base(table, numbers, given, count, period)


def _without_bad_stamps(table: Table, base: TimeBase) -> TimeBase:
    """Take the stamp before it for one that is wrong, so that no record ends there; an import leaves its row out."""
    bad = bad_stamps(base.seconds)
    if not bad.any():
        return base
    table.notes.append(note_bad_stamps(np.flatnonzero(bad) + table.first_row))
    return replace(base, seconds=in_order(base.seconds, bad))


def _begun_again(table: Table, base: TimeBase) -> TimeBase:
    """Let the stamps begin at zero with each record that the file keeps apart."""
    begins = np.array(table.begins, dtype=np.int64)
    if not begins.size:
        return base
    counts = np.diff(begins, append=base.seconds.size)
    return replace(base, seconds=base.seconds - np.repeat(base.seconds[begins], counts))


def _of_known_drive(columns: dict[str, _Column], sources: Map[str, Map[str, str]]) -> None:
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
            doubt="; ".join(doubts),
        )


def _currents(columns: dict[str, _Column]) -> None:
    """Take a current that no name calls a command for measured, where the set-point of a loop was recorded."""
    if not any(one.by_name.role in ("reference", "reference velocity") and one.moves for one in columns.values()):
        return
    for one in columns.values():
        if one.by_name.role == "command" and may_be_measured(one.parsed):
            columns[one.name] = replace(one, by_name=replace(one.by_name, role="effort"))


def _supplies(columns: dict[str, _Column]) -> None:
    """Take a voltage that hardly varies for the supply, where its name says so or another column is a command."""
    commands = [one for one in columns.values() if one.by_name.role == "command"]
    for one in commands:
        others = any(other.moves for other in commands if other is not one)
        if one.steady and (may_be_supply(one.parsed) or (others and one.parsed.unit in ("V", "mV"))):
            columns[one.name] = replace(one, by_name=RoleByName("supply", 1.0, "a voltage that hardly varies"))


def _one_joint(columns: dict[str, _Column], named: set[str], doubts: list[str]) -> dict[str, _Column]:
    """Return the columns of one joint, where a log has several: that which moves most, or that which the user names."""
    by_joint: dict[str, list[_Column]] = {}
    for one in columns.values():
        if one.by_name.role in MOTION and one.parsed.index:
            by_joint.setdefault(one.parsed.index, []).append(one)
    roles = [(one.by_name.role, one.parsed.words) for some in by_joint.values() for one in some]
    if len(by_joint) < 2 or len(set(roles)) == len(roles):
        return columns
    chosen = next((index for index, some in by_joint.items() if any(one.name in named for one in some)), None)
    if chosen is None:
        chosen = _moving_most(by_joint)
        others = (one for index, some in by_joint.items() if index != chosen for one in some)
        other = next((one for one in others if one.by_name.role == "position"), None)
        example = f", as in --position {shlex.quote(other.name)}" if other is not None else ""
        doubts.append(
            f"the log has {len(by_joint)} joints ({listed(by_joint)}); joint {chosen}, which moves most, is taken:"
            f" for another, name its columns{example}"
        )
    return {name: one for name, one in columns.items() if name in named or one.parsed.index in ("", chosen)}


def _moving_most(by_joint: Map[str, list[_Column]]) -> str:
    """Return the joint with the longest path: of its position, of its velocity where there is no position."""
    every = [one for some in by_joint.values() for one in some]
    role = "position" if any(one.by_name.role == "position" for one in every) else "velocity"
    travel: dict[str, dict[str, float]] = {}  # by quantity, then by joint
    for index, some in by_joint.items():
        for one in some:
            unit, factor = ("", 1.0)
            if one.by_name.role != role:
                continue
            if one.parsed.unit and one.parsed.unit != "counts":
                unit, factor = base_unit(one.parsed.unit, role, one.name)
            own = travel.setdefault(unit, {})
            own[index] = max(own.get(index, 0.0), factor * _travel(one.value))
    # Metres and radians compare as shares of the longest path in each.
    shares: dict[str, float] = {}
    for own in travel.values():
        largest = max(own.values()) or 1.0
        for index, one_travel in own.items():
            shares[index] = max(shares.get(index, 0.0), one_travel / largest)
    return max(shares, key=lambda index: shares[index])


def _travel(value: Floats) -> float:
    """Path of a signal beyond that of its noise: a joint at rest has none, however noisy its sensor."""
    known = value[np.isfinite(value)]
    length = 1 + known.size // _BLOCKS
    blocks = known[: known.size // length * length].reshape(-1, length).mean(axis=1)
    if blocks.size < _FEWEST_BLOCKS:
        return 0.0
    # Differences of noise are 2/√π of its standard deviation on average, and their sum varies by less than its √n-fold.
    noise = white_noise(known) / length**0.5
    steps = blocks.size - 1
    path = float(np.abs(np.diff(blocks)).sum()) - 2.0 / pi**0.5 * noise * steps
    return path if path > 4.0 * noise * steps**0.5 else 0.0


def _given(table: Table, role: str, said: Given, numbers: dict[str, Floats]) -> Guess:
    unit = said.unit
    if said.column in numbers:
        parsed = parse_column_name(said.column, table.units.get(said.column, ""))
        measured = role_by_name(parsed).role == "effort"
        return _with_unit(Guess(role, said.column, parsed.unit, "as given", measured=measured), unit)
    if said.column in table.columns:
        raise InputError(f"{table.path}: column {said.column!r} holds no numbers; it cannot be the {role}")
    if is_number(said.column) and role not in MOTION:
        return _with_unit(Guess(role, "", "", "as given", options={"value": float(said.column)}), unit)
    formula = Expression(said.column)
    missing = next((name for name in formula.columns if name not in numbers), None)
    if missing is not None or not formula.columns:
        raise InputError(
            f"{table.path}: no column {said.column!r} for the {role}; it has"
            f" {listed(numbers, 20)}{did_you_mean(said.column, numbers)}"
        )
    return _with_unit(Guess(role, said.column, "", "as given", options={"compute": said.column}), unit)


def _with_unit(guess: Guess, unit: str) -> Guess:
    """Return the guess with the unit that the user gives; ``counts/4096`` are counts of which a turn has 4096."""
    if not unit:
        return guess
    head, slash, counts = unit.partition("/")
    if slash and known_unit(head) == "counts" and is_number(counts) and float(counts) > 0.0:
        options = {**guess.options, "scale": 2.0 * pi / float(counts)}
        target = "rad/s" if "velocity" in guess.role else "rad"
        return replace(guess, unit=target, options=options, reason=f"{guess.reason}; {counts} counts per turn as given")
    if unit.startswith("-") and known_unit(unit[1:]) and guess.column:
        column = f"({guess.column})" if "compute" in guess.options else _quoted(guess.column)
        turned = f"-{column}={unit[1:]}"
        raise InputError(f"{guess.role}: a unit has no sign, but a formula has: --{guess.role} '{turned}'")
    if known_unit(unit) in ("", "counts", *SECONDS):
        raise InputError(f"{guess.role}: unknown unit {unit!r}; of an encoder give =counts/N with N counts per turn")
    return replace(guess, unit=known_unit(unit))


def _runs_of(value: Floats, base: TimeBase) -> tuple[slice, ...]:
    """Rows of each run of a column; of one with stamps of its own, all of them."""
    return tuple(base.runs) if value.size == base.seconds.size else (slice(None),)


def _columns_of(
    guess: Guess, columns: Map[str, _Column], numbers: dict[str, Floats], base: TimeBase
) -> dict[str, _Column]:
    """Return values of a guess that are among no columns yet: computed ones, and what the user has named."""
    if not guess.column or guess.column in columns:
        return {}
    computed = "compute" in guess.options
    value = Expression(guess.column).evaluate(numbers) if computed else numbers[guess.column]
    runs = _runs_of(value, base)
    return {guess.column: _Column(guess.column, ColumnName((), "", ""), RoleByName("", 0.0, ""), value, runs)}


def _by_name(role: str, columns: dict[str, _Column], chosen: dict[str, Guess], given: Map[str, Given]) -> Guess | None:
    """Return the column whose name says that it has the role, of several the surest one."""
    taken = {one.column for one in chosen.values()} | {one.column for one in given.values()}
    free = [one for one in columns.values() if one.name not in taken and one.by_name.role == role]
    moving = [one for one in free if one.moves]
    if role in ("velocity", "effort"):
        free = moving
    elif role in ("reference", "reference velocity"):
        # A set-point may be held; one at zero throughout was not in use.
        free = moving or [one for one in free if np.nan_to_num(one.value).any()]
    if not free:
        return None
    best = max(moving or free, key=lambda one: one.by_name.rank)
    guess = best.as_guess(role)
    also = [one.name for one in moving if one is not best and one.by_name.rank > best.by_name.rank - 1.0]
    if role == "command" and best.by_name.reason == BY_UNIT:
        # A unit alone says little: what has no name may be meant.
        also += [one.name for one in columns.values() if one.name not in taken and one.moves and not one.by_name.role]
    if also and role in ("command", *MOTION):
        guess = guess.with_doubt(f"{role}: {listed(also)} could be meant as well: --{role} COLUMN")
    if role == "command" and best.steady and (best.parsed.unit or _unit_by_words(best.parsed)) in ("V", "mV"):
        guess = guess.with_doubt(
            f"command: {best.name!r} hardly varies: if it is the supply, --supply '{best.name}' and --command COLUMN"
        )
    elif role == "command" and not np.nan_to_num(best.value).any():
        guess = guess.with_doubt(f"command: {best.name!r} is zero throughout: if another is meant, --command COLUMN")
    elif role == "command" and may_be_measured(best.parsed):
        guess = guess.with_doubt(
            f"command: no name says that {best.name!r} was commanded: if it was measured, set"
            " `input: {kind: measured}` in the model file"
        )
    return _with_unit(guess, given.get(role, Given()).unit)


def _output(columns: dict[str, _Column], chosen: dict[str, Guess], given: Map[str, Given]) -> None:
    """Decide whether an output ``y`` is a position or a velocity."""
    place, command = chosen.get("position"), chosen.get("command")
    named = given.keys() & set(MOTION) or "velocity" in chosen
    if place is None or command is None or named or place.unit or parse_column_name(place.column).words != ("y",):
        return
    driven = columns.get(command.column)
    if driven is not None and _follows(columns[place.column].value, driven.value):
        del chosen["position"]
        chosen["velocity"] = replace(place, role="velocity", reason="an output that is large where the command is")
    doubt = f"{place.column!r} may be a position or a velocity: --position {place.column} or --velocity {place.column}"
    role = "velocity" if "velocity" in chosen else "position"
    chosen[role] = chosen[role].with_doubt(doubt)


def _by_data(base: TimeBase, columns: dict[str, _Column], chosen: dict[str, Guess], given: Map[str, Given]) -> None:
    """Fill roles whose columns have names that say nothing: a command jumps, a motion is smooth."""
    lacks_command = "command" not in chosen and given.get("command", Given()).column != NONE
    held = [one for one in _nameless(columns, chosen) if one.is_held]
    if lacks_command and len(held) == 1:
        chosen["command"] = _by_values("command", held[0], "it is constant in each run")
        lacks_command = False
    _velocity_by_slope(base, columns, chosen, given)
    free = _nameless(columns, chosen)
    # Only a few columns can be told apart by their looks.
    if not free or len(free) > _MOST_BY_LOOKS:
        return
    free = [free[k] for k in smoothest_first([(one.value, one.runs) for one in free])]
    if not any(role in chosen for role in MOTION) and given.get("position", Given()).column != NONE:
        smoothest = free.pop(0)
        if free and _same(smoothest.value, free[0].value):
            # Of two that run together the one with less noise is the set-point, which is found below.
            smoothest = max(smoothest, free.pop(0), key=lambda one: change_by_noise(one.value)[0])
        taken = {one.column for one in chosen.values()}
        # A position and a velocity are both larger in the runs in which a held command is.
        driven = [one.value for one in columns.values() if (one in free or one.name in taken) and not one.is_held]
        may_be = given.get("velocity", Given()).column != NONE
        role = "velocity" if may_be and any(_follows(smoothest.value, one) for one in driven) else "position"
        chosen[role] = _by_values(role, smoothest, "it is the smoothest of the columns that are left")
    # What was measured acts as the input, and its name says so.
    if lacks_command and free and "effort" not in chosen:
        chosen["command"] = _by_values("command", free[-1], "it jumps most of the columns that are left")


def _nameless(columns: Map[str, _Column], chosen: Map[str, Guess]) -> list[_Column]:
    """Columns that move, have no role yet, and have names that say none."""
    taken = {one.column for one in chosen.values()}
    return [one for one in columns.values() if one.name not in taken and one.moves and not one.by_name.role]


def _by_values(role: str, one: _Column, reason: str) -> Guess:
    options = "--position or --velocity" if role in MOTION else f"--{role}"
    return Guess(
        role,
        one.name,
        one.parsed.unit,
        reason,
        f"no name says what {one.name!r} is, it is taken as the {role}: {options} COLUMN",
    )


def _velocity_by_slope(
    base: TimeBase, columns: dict[str, _Column], chosen: dict[str, Guess], given: Map[str, Given]
) -> None:
    """Find the velocity among the columns whose names say nothing: it runs with the slope of the position.

    Without a motion by its name, the position is found with it.
    """
    if "velocity" in chosen or given.get("velocity", Given()).column == NONE:
        return
    taken = {one.column for one in given.values()}
    free = [one for one in _nameless(columns, chosen) if one.name not in taken]
    place = chosen.get("position")
    if place is not None:
        positions = [columns[place.column]]
    elif len(free) <= _MOST_BY_LOOKS and given.get("position", Given()).column != NONE:
        positions = free
    else:
        return
    spare = "command" in chosen or "effort" in chosen or given.get("command", Given()).column == NONE
    spare = spare or any(not one.moves and not one.by_name.role for one in columns.values())
    last = len(free) - (place is None) < 2 - spare
    found = []
    for position in positions:
        value = position.unwrapped("counts" if "scale" in position.options else position.parsed.unit)
        for one in free[:_MOST_COMPARED]:
            if one is position or not one.value.size == value.size == base.seconds.size:
                continue
            # The last column may be a force as well, which runs with the slope by chance in no unit of a velocity.
            if last and not _in_units(base, position.parsed.unit, value, one):
                continue
            if (slope := slope_of(base.seconds, value, one.value, position.runs)) is not None:
                found.append((slope.correlation, position, one))
    if not found:
        return
    _, position, best = max(found, key=lambda one: one[0])
    if place is None:
        chosen["position"] = _by_values("position", position, f"{best.name!r} runs with its slope")
    guess = Guess("velocity", best.name, best.parsed.unit, "it runs with the slope of the position")
    chosen["velocity"] = _with_unit(guess, given.get("velocity", Given()).unit).with_doubt(
        f"no name says what {best.name!r} is, by the slope of the position it is taken as the velocity:"
        " --velocity COLUMN or none"
    )


def _in_units(base: TimeBase, unit: str, position: Floats, rate: _Column) -> bool:
    """Whether a column is the slope of a position in some unit of a velocity."""
    run = _longest_way(position, rate.runs)
    series = (base.seconds[run], position[run], rate.value[run])
    return motion_units(*series, (unit, ""), base.units[:1], linear=False).agree


def _set_point(columns: dict[str, _Column], chosen: dict[str, Guess], given: Map[str, Given]) -> None:
    """Find the set-point of the position among the columns whose names say nothing: it runs with it."""
    place = chosen.get("position")
    if place is None or "reference" in chosen or given.get("reference", Given()).column == NONE:
        return
    taken = {one.column for one in chosen.values()}
    for one in columns.values():
        if (
            one.name not in taken
            and one.moves
            and not one.by_name.role
            and _same(columns[place.column].value, one.value)
        ):
            chosen["reference"] = Guess(
                "reference",
                one.name,
                one.parsed.unit,
                f"it runs with {place.column!r}",
                f"{one.name!r} is taken as the set-point of {place.column!r}: --reference COLUMN",
            )
            return


def _same(one: Floats, other: Floats) -> bool:
    """Whether two columns run together."""
    if one.size != other.size:
        return False
    known = np.isfinite(one) & np.isfinite(other)
    return bool(known.any()) and float(np.std((one - other)[known])) < 0.1 * float(np.std(one[known]))


def _follows(motion: Floats, command: Floats) -> bool:
    """Whether a motion is large where the command is, as a velocity is, and a position is not."""
    if motion.size != command.size:
        return False
    known = np.isfinite(motion) & np.isfinite(command)
    if known.sum() < 3 or not (np.ptp(motion[known]) and np.ptp(command[known])):
        return False
    return abs(float(np.corrcoef(motion[known], command[known])[0, 1])) > _FOLLOWS


def _no_command(
    table: Table, base: TimeBase, chosen: dict[str, Guess], given: Map[str, Given], doubts: list[str]
) -> None:
    """Find a command where no column is one: in the name of the file, or a measured force; else refuse."""
    if "command" in chosen or given.get("command", Given()).column == NONE:
        if "command" not in chosen:
            doubts.append("without a command nothing can be fitted to this record")
        return
    effort = chosen.get("effort")
    in_name = _in_file_name(table.path)
    if in_name is not None:
        pattern, number, unit = in_name
        chosen["command"] = Guess(
            "command",
            "",
            unit,
            f"{number:g} in the name of the file",
            "the command is taken from the name of the file: --command VALUE=UNIT, or --command COLUMN",
            {"file_name": pattern},
        )
    elif effort is not None:
        del chosen["effort"]
        chosen["command"] = replace(effort, role="command").with_doubt(
            f"no command was recorded; the measured {effort.column!r} acts as the input"
        )
    else:
        reference = chosen.get("reference") or chosen.get("reference velocity")
        loop = (
            f" ({reference.column!r} is a set-point by its name: record the current, torque or voltage of the drive as"
            f" well; if it is one of these, --command '{reference.column}=UNIT')"
            if reference is not None
            else ""
        )
        stamps = {base.time.column, *table.clocks.values()}
        free = [name for name in table.columns if name not in stamps]
        raise InputError(
            f"{table.path}: no column is a command (force, torque, current, voltage, duty cycle){loop}; name one of"
            f" {listed(free, 20)} with --command COLUMN, give a constant with --command VALUE=UNIT, or leave"
            " it out with --command none"
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


def _units(base: TimeBase, chosen: dict[str, Guess], columns: dict[str, _Column], given: Map[str, Given]) -> TimeBase:
    """Set the units that no name says, and note which of them are uncertain."""
    command = chosen.get("command")
    if command is not None and command.unit in SECONDS:
        chosen["command"] = command = _pulse_width(command)
    elif command is not None and not command.unit:
        chosen["command"] = command = _command_unit(command)
    effort = chosen.get("effort")
    if effort is not None and not effort.unit:
        unit = _command_unit(effort).unit
        chosen["effort"] = replace(effort, unit=unit if unit != "-" or command is None else command.unit)
    place, speed = chosen.get("position"), chosen.get("velocity")
    words = {word for one in (place, speed) if one for word in parse_column_name(one.column).words}
    linear = (
        any(one.unit in _LINEAR_UNITS for one in (place, speed) if one)
        or (command is not None and command.unit in _LINEAR_FORCES)
        or bool(words & _LINEAR_WORDS)
    )
    counted = None
    if place is not None and (place.unit == "counts" or (not place.unit and _is_count(place, columns))):
        counted, place = place, _counts(place, columns[place.column])
        chosen["position"] = place
    elif place is not None and not place.unit and not linear and _counts_many(columns[place.column].value):
        trial = dict(chosen)
        if speed is not None:
            _related(base, trial, columns, linear=False, given=given)
        # Degrees, where a velocity proves them, are no counts.
        if trial["position"].unit != "deg":
            why = f"{place.column!r} holds large whole numbers, probably counts of an encoder; "
            counted, place = place, _counts(place, columns[place.column], why)
            chosen["position"] = place
    if place is not None and speed is not None:
        base = _related(base, chosen, columns, linear=linear, given=given, counted=counted)
    elif place is not None and not place.unit:
        chosen["position"] = _position_alone(place, columns[place.column], linear=linear)
    elif speed is not None and not speed.unit and _IN_HERTZ.search(speed.column):
        chosen["velocity"] = replace(speed, unit="rev/s").with_doubt(
            f"the velocity is in hertz, taken as turns per second: --velocity '{speed.column}=UNIT'"
        )
    elif speed is not None and not speed.unit:
        unit = "m/s" if linear else "rad/s"
        chosen["velocity"] = replace(speed, unit=unit).with_doubt(
            f"{_without_unit(speed)} and taken as {unit}: --velocity '{speed.column}=UNIT'"
        )
    elif speed is not None and speed.unit == "counts":
        chosen["velocity"] = replace(speed, unit="rad/s").with_doubt(
            f"the size of a count is not known; one is taken as 1 rad: --velocity '{speed.column}=counts/N'"
        )
    _reference_units(chosen)
    for role, one in chosen.items():
        if not one.unit:
            column = one.column or f"{one.options['value']:g}"
            chosen[role] = one.with_doubt(f"{_without_unit(one)}: --{role} '{column}=UNIT'")
    return base


def _unit_by_words(name: ColumnName) -> str:
    """Unit of a force, torque, current or voltage by the words of its name."""
    unit = next((unit for some, unit in _UNITS_OF_WORDS if some.intersection(name.words)), "")
    return {"V": "V", "U": "V", "I": "A", "F": "N", "T": "N·m", "M": "N·m"}.get(name.letter, unit)


def _command_unit(command: Guess) -> Guess:
    parsed = parse_column_name(command.column)
    words, unit = set(parsed.words), _unit_by_words(parsed)
    if unit:
        return replace(command, unit=unit).with_doubt(
            f"{_without_unit(command)} and taken as {unit}: --command '{command.column}=UNIT'"
        )
    # A duty cycle has no unit, and of an unknown one only ratios of the parameters matter.
    duty = bool(words & {"pwm", "duty", "dutycycle", "throttle"})
    text = "" if duty else f"the unit of the command is not known: --command '{command.column}=UNIT'"
    found = replace(command, unit="-")
    return found.with_doubt(text) if text else found


def _without_unit(guess: Guess) -> str:
    """Say that a unit is not written down, or that what is written is none that is known."""
    written = unknown_unit(guess.column) or "%" * ("%" in guess.column)
    return (
        f"the unit {written!r} of the {guess.role} is not known"
        if written
        else (f"the unit of the {guess.role} is not written down")
    )


def _pulse_width(command: Guess) -> Guess:
    """Command of a hobby servo or speed controller: a pulse of 1 to 2 ms, with zero in the middle."""
    scale = SECONDS[command.unit] / SECONDS["ms"]
    found = replace(command, unit="-", options=command.options | {"scale": 2.0 * scale, "offset": -3.0})
    return found.with_doubt(
        "the command is a pulse width; 1.5 ms is taken as zero, 2 ms as full: edit `scale` and `offset` in the mapping"
    )


def _is_count(place: Guess, columns: dict[str, _Column]) -> bool:
    """Whether a position without a unit counts the steps of an encoder: whole numbers that start again, or its name."""
    column = columns[place.column]
    known = column.value[np.isfinite(column.value)]
    if (known != np.round(known)).any():
        return False
    words = set(parse_column_name(place.column).words)
    return bool(words & _ENCODERS or (np.ptp(known) > _FEWEST_COUNTS and column.wrap("counts") > 0.0))


def _counts_many(value: Floats) -> bool:
    """Whether a position holds whole numbers larger than an angle in rad."""
    known = value[np.isfinite(value)]
    return bool((known == np.round(known)).all() and np.abs(known).max() >= _MANY_COUNTS)


def _counts(place: Guess, column: _Column, why: str = "") -> Guess:
    """Set the size of an encoder's count: by its wrap, or as unknown; `why` it may be one, where nothing says so."""
    whole = column.wrap("counts")
    if whole:
        return replace(
            place,
            unit="rad",
            options={**place.options, "scale": 2.0 * pi / whole, "wrap": 2.0 * pi},
            reason=f"{place.reason}; starts again after {whole:g} counts",
        ).with_doubt(f"{whole:g} counts are taken as one turn: --position '{place.column}=counts/N'")
    return replace(place, unit="rad").with_doubt(
        f"{why}the size of a count is not known; one is taken as 1 rad: --position '{place.column}=counts/N' with the"
        " counts per turn N"
    )


def _position_alone(place: Guess, column: _Column, *, linear: bool) -> Guess:
    for unit in () if linear else ("rad", "deg"):
        if column.wrap(unit):
            return replace(place, unit=unit, reason=f"{place.reason}; starts again after a turn in {unit}")
    unit = "m" if linear else "rad"
    return replace(place, unit=unit).with_doubt(
        f"{_without_unit(place)} and taken as {unit}: --position '{place.column}=UNIT'"
    )


def _related(
    base: TimeBase,
    chosen: dict[str, Guess],
    columns: dict[str, _Column],
    *,
    linear: bool,
    given: Map[str, Given],
    counted: Guess | None = None,
) -> TimeBase:
    """Set units of position and velocity by the slope of one against the other.

    `counted` is a position in counts of a size that nothing else says, as it was before a size was assumed.
    """
    place, speed = chosen["position"], chosen["velocity"]
    column, rate = columns[place.column], columns[speed.column].value
    if column.value.size != base.seconds.size or rate.size != base.seconds.size:
        return _unrelated(base, chosen, linear=linear)
    scale = place.options.get("scale", 1.0)
    value = column.unwrapped(place.unit if scale == 1.0 else "counts") * scale
    rate = rate * speed.options.get("scale", 1.0)
    run = _longest_way(value, column.runs)
    speed_unit = "" if speed.unit == "counts" else speed.unit
    found = motion_units(
        base.seconds[run],
        value[run],
        rate[run],
        (place.unit, speed_unit),
        base.units,
        linear=linear,
    )
    if not found.agree:
        _unrelated(base, chosen, linear=linear)
        slope = slope_of(base.seconds, value, rate, column.runs)
        if slope is not None and not speed_unit:
            chosen["velocity"] = _scaled_by_slope(chosen["velocity"], speed, chosen["position"].unit, slope.value)
        elif slope is not None and counted:
            factor = base_unit(speed.unit, "velocity", speed.column)[1]
            # Over long windows the slope is exact, where it can be told there.
            exact = found.slope if np.isfinite(found.slope) else slope.value * factor
            chosen["position"], chosen["velocity"] = _count_by_slope(counted, speed, exact * scale)
        return base
    times = f"it is the slope of the position in {found.position} and {found.velocity}"
    options = dict(speed.options)
    if found.slope < 0.0:
        options["scale"] = -options.get("scale", 1.0)
    turned = replace(speed, unit=found.velocity, options=options, reason=f"{speed.reason}; {times}")
    if found.slope < 0.0:
        turned = turned.with_doubt("position and velocity have opposite signs; that of the velocity is turned")
    chosen["velocity"] = turned
    if not place.unit:
        chosen["position"] = replace(place, unit=found.position, reason=f"{place.reason}; {times}")
        if not speed_unit:
            chosen["position"] = chosen["position"].with_doubt(
                f"no unit is written down; position in {found.position} and velocity in {found.velocity} agree:"
                f" --position '{place.column}=UNIT'"
            )
    if found.time != base.units[0]:
        factor = SECONDS[found.time] / SECONDS[base.units[0]]
        reason = f"{base.reason}; but with {found.time} the velocity is the slope of the position"
        base = replace(
            base,
            time=Time(column=base.time.column, unit=found.time),  # type: ignore[arg-type]
            seconds=base.seconds * factor,
            units=(found.time,),
            reason=reason,
            doubt="",
        )
    elif len(base.units) > 1:
        base = replace(base, units=(found.time,), doubt="", reason=f"{base.reason}, and so says the velocity")
    return base


def _longest_way(position: Floats, runs: Iterable[slice]) -> slice:
    """Return the run in which the position moves furthest, which shows most."""
    return max(runs, key=lambda run: float(np.nan_to_num(np.ptp(position[run]))))


def _scaled_by_slope(taken: Guess, speed: Guess, place: str, slope: float) -> Guess:
    """Scale a velocity to the slope of the position where the factor is no unit's; else return what it is taken for."""
    unit, factor = base_unit(place, "position", "")
    if near_unit(slope * factor):
        return taken
    options = speed.options | {"scale": float(f"{factor / slope:.4g}")}
    return replace(speed, unit=f"{unit}/s", options=options).with_doubt(
        f"the unit of the velocity is not known; it is {slope:.4g} times the slope of the position and scaled so:"
        f" --velocity '{speed.column}=UNIT'"
    )


def _count_by_slope(place: Guess, speed: Guess, slope: float) -> tuple[Guess, Guess]:
    """Set the size of a count so that a velocity in a known unit, in rad/s or m/s `slope` per count, is their slope."""
    unit, _ = base_unit(speed.unit, "velocity", speed.column)
    size, options = abs(slope), dict(speed.options)
    if slope < 0.0:
        options["scale"] = -options.get("scale", 1.0)
    turned = replace(speed, options=options)
    if slope < 0.0:
        turned = turned.with_doubt("position and velocity have opposite signs; that of the velocity is turned")
    if unit != "rad/s":
        size, unit = float(f"{size:.4g}"), unit.removesuffix("/s")
        way = f"--position '{_quoted(place.column)} * {size:g}={unit}'"
        said = f"a count of {size:g} {unit}"
    else:
        counts = usual_resolution(2.0 * pi / size)
        size, unit = 2.0 * pi / counts, "rad"
        way, said = f"--position '{place.column}=counts/N'", f"{counts:g} counts per turn"
    found = replace(
        place,
        unit=unit,
        options={**place.options, "scale": size},
        reason=f"{place.reason}; with {said} the velocity is its slope",
    )
    return found.with_doubt(f"{said}: found by the velocity in {speed.unit}; if it is another, {way}"), turned


def _unrelated(base: TimeBase, chosen: dict[str, Guess], *, linear: bool) -> TimeBase:
    for role, usual in (("position", "m" if linear else "rad"), ("velocity", "m/s" if linear else "rad/s")):
        one = chosen[role]
        if not one.unit or one.unit == "counts":
            chosen[role] = replace(one, unit=usual).with_doubt(
                f"{_without_unit(one)} and taken as {usual}: --{role} '{one.column}=UNIT'"
            )
    return base


def _reference_units(chosen: dict[str, Guess]) -> None:
    """A set-point has the unit of what it is set for."""
    reference = chosen.get("reference")
    if reference and not {"position", "reference velocity"} & chosen.keys() and not _is_of_position(reference):
        chosen["reference velocity"] = replace(chosen.pop("reference"), role="reference velocity")
    for role, motion in (("reference", "position"), ("reference velocity", "velocity")):
        one, other = chosen.get(role), chosen.get(motion)
        if one is None or (one.unit and one.unit != "counts"):
            continue
        if other is None or _other_letters(one, other):
            del chosen[role]
            continue
        options = {key: other.options[key] for key in ("scale", "wrap") if key in other.options}
        chosen[role] = replace(
            one, unit=other.unit, options=one.options | options, reason=f"{one.reason}; unit of the {motion}"
        )


def _is_of_position(reference: Guess) -> bool:
    """Whether a name says that a set-point is of the position, not only that it is one."""
    name = parse_column_name(reference.column)
    rest = tuple(word for word in name.words if word not in WANTED)
    return role_by_name(replace(name, words=rest, unit=reference.unit)).role == "position"


def _other_letters(reference: Guess, motion: Guess) -> bool:
    """Whether two letters name other quantities, as p_soll and n_ist do; r is the set-point of anything."""
    letters = {parse_column_name(one.column).letter.lower() for one in (reference, motion)} - {""}
    return len(letters - {"r"}) == 2


def _decode(chosen: dict[str, Guess], columns: dict[str, _Column], given: Map[str, Given]) -> None:
    """Unwrap positions, and read negative numbers that were logged as unsigned ones."""
    for role, guess in list(chosen.items()):
        column = columns.get(guess.column)
        if column is None or "decode" in guess.options or "wrap" in guess.options:
            continue
        options = dict(guess.options)
        if role in ("position", "reference"):
            scale = options.get("scale", 1.0)
            if whole := column.wrap(guess.unit if scale == 1.0 else "counts"):
                options["wrap"] = whole * scale
                reason = f"{guess.reason}; starts again after {whole:g}"
                chosen[role] = replace(guess, options=options, reason=reason)
        elif role in ("command", "velocity", "effort") and (kind := find_decoding(column.value)):
            options["decode"] = kind
            chosen[role] = replace(guess, options=options).with_doubt(
                f"{role}: values near {column.value.max():g} are read as negative ({kind})"
            )


def base_field(role: str) -> str:
    """Field of JointState whose units a role may have."""
    return {"command": "effort", "effort": "effort", "reference": "position", "reference velocity": "velocity"}.get(
        role, role if role in MOTION else "condition"
    )


def base_unit_of(guess: Guess) -> str:
    """Unit of the topics that a guess becomes."""
    return base_unit(guess.unit, base_field(guess.role), guess.role)[0]
