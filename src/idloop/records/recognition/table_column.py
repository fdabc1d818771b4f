"""The columns of numbers of a log, what their values alone say, and what has been chosen of them so far."""

from __future__ import annotations

from collections.abc import Mapping as Map
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.inspection.motion import ROUNDING
from idloop.records.recognition.column_name import ColumnName, parse_column_name
from idloop.records.recognition.guess import MOTION, NONE, Given, Guess
from idloop.records.recognition.roles import RoleByName, role_by_name
from idloop.records.recognition.signal_units import SlopeOf, decoded, find_decoding, find_wrap, slope_of, steps_per_turn
from idloop.records.recognition.time_base import TimeBase, counts_rows
from idloop.records.tables.base_units import COUNTS, SECONDS
from idloop.records.tables.mapping import SignBit
from idloop.records.tables.table import Table

# What a velocity is in that is written in the unit of a position.
_PER_SECOND = {unit: f"{unit}/s" for unit in ("rad", "mrad", "deg", "rev", "m", "cm", "mm", "um", "in")}
_FEWEST_STAMPS = 10  # a motion may have the values of a few stamps
_STEADY = 0.1  # of its mean, for a supply
# Of the step of a column, and of its variance, by which rounding leaves it beside a multiple of another.
_HALF_STEP, _UNLIKE = 0.6, 1e-3
_LINE = 1e-3  # of the spread of a column, by which one that runs with the time or the rows leaves a straight line


@dataclass(frozen=True)
class TableColumn:
    """One column of numbers."""

    name: str
    parsed: ColumnName
    by_name: RoleByName
    value: Array
    runs: tuple[slice, ...] = (slice(None),)
    options: dict[str, Any] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    def as_guess(self, role: str, reason: str = "", *, unit_given: bool = False) -> Guess:
        """What it is in this role: by its name, by the drive whose log it is of, or for another reason.

        Where the user gives its unit, that of the name leaves no doubt.
        """
        unit, factor, written, doubts = self.parsed.unit, self.parsed.factor, self.parsed.written, self.doubts
        options = dict(self.options)
        if unit in ("%", "-") and role in (*MOTION, "reference", "reference velocity"):
            unit, factor, written = "", 1.0, unit  # of what, nothing says
        elif "velocity" in role and unit in _PER_SECOND:
            unit = _PER_SECOND[unit]
            doubt = f"the unit of the {role} is written as {self.parsed.unit!r}, which is taken per second"
            doubts = doubts if unit_given else (doubt, *doubts)
        elif role == "temperature":
            # The last of the words of a name without a unit stands for degrees Celsius as well.
            said = (unit or written).casefold().removeprefix("deg").strip(" .°")
            if said == "c" or (not said and (unit or written or self.parsed.words[-1:] == ("c",))):
                unit, factor, written = "°C", 1.0, ""
        if factor != 1.0:
            options["scale"] = factor * options.get("scale", 1.0)
        unit = unit.removesuffix("/s") if unit in COUNTS else unit
        reason = reason or self.by_name.reason
        return Guess(role, self.name, unit, reason, doubts, options, self.by_name.role == "effort", written)

    def as_other(self) -> TableColumn:
        """Return it as no signal of the axis."""
        return replace(self, by_name=RoleByName("other"))

    def with_sign(self) -> TableColumn:
        """Return it with the sign of negative numbers that were logged as large positive ones."""
        if known := self.options.get("decode"):
            kind = SignBit.model_validate(known) if isinstance(known, dict) else known
            try:
                return replace(self, value=decoded(self.value, kind))
            except InputError:  # values that are not logged so
                return replace(self, options={key: one for key, one in self.options.items() if key != "decode"})
        found = find_decoding(self.value)
        # A position in two's complement starts again, as that of an encoder does.
        if found is None or (isinstance(found, str) and self.by_name.role in ("position", "reference")):
            return self
        bit = found.sign_bit if isinstance(found, SignBit) else None
        option, how = (found, found) if bit is None else ({"sign_bit": bit}, f"bit {bit} is the sign")
        doubt = f"{self.name!r}: values near {np.nanmax(self.value):g} are read as negative ({how})"
        options = {**self.options, "decode": option}
        return replace(self, value=decoded(self.value, found), options=options, doubts=(*self.doubts, doubt))

    @property
    def moves(self) -> bool:
        """Whether it is not constant."""
        known = self.value[np.isfinite(self.value)]
        return bool(known.size > 1 and float(np.ptp(known)) > 0.0)

    @property
    def decades(self) -> int:
        """How many different values it has, as a power of ten below that."""
        return len(str(np.unique(self.value[np.isfinite(self.value)]).size))

    @property
    def whole_numbers(self) -> int:
        """How many different whole numbers it holds; 0 where it holds others."""
        known = self.value[np.isfinite(self.value)]
        return int(np.unique(known).size) if bool((known == np.round(known)).all()) else 0

    @property
    def steady(self) -> bool:
        """Whether it is above zero and hardly varies, as a supply voltage."""
        return float(np.nanstd(self.value)) < _STEADY * float(np.nanmean(self.value))

    @property
    def is_angle(self) -> bool:
        """Whether its steps are those of an encoder in rad or deg."""
        return any(steps_per_turn(self.value, unit) for unit in ("rad", "deg"))

    @property
    def is_held(self) -> bool:
        """Whether it is constant in each of several runs."""
        return len(self.runs) > 1 and all(float(np.ptp(self.value[run])) == 0.0 for run in self.runs)

    def times(self, other: TableColumn) -> float:
        """Factor by which it is another column, but for a constant and its rounding; 0 where it is another signal."""
        if self.value.size != other.value.size:
            return 0.0
        known = np.isfinite(self.value) & np.isfinite(other.value)
        one, beside = self.value[known], other.value[known]
        if one.size < _FEWEST_STAMPS or not (np.ptp(one) and np.ptp(beside)):
            return 0.0
        one, beside = one - one.mean(), beside - beside.mean()
        factor = float(one @ beside / (beside @ beside))
        left = one - factor * beside
        step = max(float(np.diff(np.unique(one)).min()), ROUNDING * float(np.ptp(one)))
        rounded = float(np.abs(left).max()) < _HALF_STEP * step or float(np.std(left)) < ROUNDING * float(np.ptp(one))
        return factor if rounded and float(np.var(left)) < _UNLIKE * float(np.var(one)) else 0.0

    def wrap(self, unit: str) -> float:
        """Range after which it starts again within a run, in its unit; 0 where it does not."""
        return max(find_wrap(self.value[run], unit) for run in self.runs)

    def unwrapped(self, unit: str) -> Array:
        """Its values without the jumps where it starts again."""
        value, whole = self.value.copy(), self.wrap(unit)
        known = np.isfinite(value)
        if whole:
            value[known] = np.unwrap(value[known], period=whole)
        return np.asarray(value)

    def is_further_clock(self, seconds: Array) -> bool:
        """Whether it is one more clock or counter: on a line over the stamps or the rows, with no name against that.

        A motion at one speed from the first row to the last would show nothing either.
        """
        # A value that is set may rise by one with each row, such as a duty cycle: then its own name says so.
        own = role_by_name(parse_column_name(self.name.rpartition(".")[2])).role
        plain = not self.parsed.unit and own != "command"
        # A counter may begin anew with each run.
        if plain and counts_rows(_from_beginnings(self.value, self.runs)):
            return True
        if not self.moves or self.value.size != seconds.size:
            return False
        enough = self.value.size > _FEWEST_STAMPS
        if plain and enough and any(np.array_equal(self.value * factor, seconds) for factor in SECONDS.values()):
            return True
        if self.by_name.role:
            return False
        # A value that is not finite leaves no correlation.
        three = (self.value, seconds, np.arange(seconds.size, dtype=np.float64))
        along = np.corrcoef([_from_beginnings(one, self.runs) for one in three])[0, 1:]
        return bool((1.0 - along**2 < _LINE**2).any())


def _from_beginnings(value: Array, runs: Sequence[slice]) -> Array:
    """Return what a column has gone since each run began, one run after the other."""
    gone, end = [], 0.0
    for one in (value[run] for run in runs):
        if one.size:
            gone.append(one - one[0] + end)
            end = float(gone[-1][-1]) + 1.0
    return np.concatenate(gone)


def numbers_of(table: Table) -> dict[str, Array]:
    """Columns that hold numbers, without those of a table with one clock that are no part of its record."""
    found = {}
    for name in table.columns:
        try:
            value = table.numbers(name)
        except InputError:
            continue
        # What is infinite was not measured; an import says so.
        if np.isfinite(value).sum() > 1:
            found[name] = np.where(np.isfinite(value), value, np.nan)
    # Beside one record a workspace holds the settings of models, matrices and results.
    longest = 0 if table.clocks else max((value.size for value in found.values()), default=0)
    return {name: value for name, value in found.items() if 2 * value.size > longest}


def runs_of(value: Array, base: TimeBase) -> tuple[slice, ...]:
    """Rows of each run of a column; of one with stamps of its own, all of them."""
    return tuple(base.runs) if value.size == base.seconds.size else (slice(None),)


@dataclass
class Choice:
    """The columns, and what has been chosen of them so far."""

    table: Table
    base: TimeBase
    given: Map[str, Given]  # what the user says, by role
    columns: dict[str, TableColumn] = field(default_factory=dict)
    chosen: dict[str, Guess] = field(default_factory=dict)  # by role
    doubts: list[str] = field(default_factory=list)  # beside those of the roles

    def said(self, role: str) -> str:
        """Column that the user gives for a role; empty without one."""
        return self.given.get(role, Given()).column

    def left_out(self, role: str) -> bool:
        """Whether the user leaves a role out."""
        return self.said(role) == NONE

    def column(self, role: str) -> TableColumn | None:
        """Column that is chosen for a role."""
        return self.columns.get(self.chosen[role].column) if role in self.chosen else None

    def change(self, role: str, doubt: str = "", **changes: Any) -> Guess:
        """Change what is chosen for a role, with a further doubt."""
        one = replace(self.chosen[role], **changes)
        self.chosen[role] = one.with_doubt(doubt) if doubt else one
        return self.chosen[role]

    def nameless(self) -> list[TableColumn]:
        """Columns that move, have no role yet, and have names that say none."""
        taken = {one.column for one in self.chosen.values()}
        return [one for one in self.columns.values() if one.name not in taken and one.moves and not one.by_name.role]

    def slope(self, place: TableColumn, rate: TableColumn, unit: str | None = None) -> SlopeOf | None:
        """Compare a column with the slope of a position in a unit, by default that of its name; see `slope_of`."""
        if not place.value.size == rate.value.size == self.base.seconds.size:
            return None
        value = place.unwrapped(unit if unit is not None else place.parsed.unit or "counts")
        return slope_of(self.base.seconds, value, rate.value, place.runs)
