"""One guess about a log, with its reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

from idloop.errors import InputError
from idloop.records.tables.base_units import COUNTS, SECONDS, known_unit, read_unit
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.expression import Expression, in_backquotes
from idloop.records.tables.table import Table
from idloop.spelling import did_you_mean, listed

MOTION = ("position", "velocity")
LOAD = "load"  # a second position, of what the axis drives through a gear, belt or spring
SET_POINTS = ("reference", "reference velocity")
# Roles that may stand in a mapping file, in its order.
ROLES = (
    "command", "position", "velocity", LOAD, "effort", "reference", "reference velocity", "temperature", "supply",
)  # fmt: skip
NONE = "none"


@dataclass(frozen=True)
class Guess:
    """What a column is taken for."""

    # ``command``, ``position``, ``velocity``, ``load``, ``effort``, ``reference``, ``reference velocity``, or the name
    # of a condition
    role: str
    column: str  # column or formula; empty where the value stands elsewhere, such as in the name of the file
    unit: str  # as a mapping file writes it
    reason: str  # why this column, and why this unit
    doubts: tuple[str, ...] = ()  # what is uncertain and how to say otherwise
    # Further keys of the channel in the mapping: ``scale``, ``wrap``, ``decode``, ...
    options: dict[str, Any] = field(default_factory=dict)
    measured: bool = False  # whether the name says that a force, torque, current or voltage was measured
    written: str = ""  # what the log writes as its unit, where that is none that is known

    def with_doubt(self, doubt: str) -> Guess:
        """Return it with a further doubt."""
        return replace(self, doubts=(*self.doubts, doubt))


@dataclass(frozen=True)
class Given:
    """What the user says of one role, and so is not guessed."""

    column: str = ""  # column or formula; empty where only the unit is given
    unit: str = ""  # empty where not given; ``counts/4096`` is an encoder of 4096 counts per turn

    @classmethod
    def parse(cls, text: str, columns: list[str]) -> Given:
        """Read ``COLUMN``, ``COLUMN=UNIT`` or ``=UNIT``."""
        if text in columns:
            return cls(text)
        column, equals, unit = text.rpartition("=")
        return cls(column.strip(), unit.strip()) if equals else cls(text.strip())


def with_unit(guess: Guess, unit: str) -> Guess:
    """Return the guess with the unit that the user gives; ``counts/4096`` are counts of which a turn has 4096."""
    if not unit:
        return guess
    # What the header or the manual of the drive says of the unit no longer holds.
    kept = {key: value for key, value in guess.options.items() if key not in ("scale", "offset", "wrap")}
    guess = replace(guess, options=kept)
    head, slash, counts = unit.partition("/")
    if slash and known_unit(head) == "counts" and is_number(counts) and float(counts) > 0.0:
        options = {**guess.options, "scale": 2.0 * pi / float(counts)}
        target = "rad/s" if "velocity" in guess.role else "rad"
        return replace(guess, unit=target, options=options, reason=f"{guess.reason}; {counts} counts per turn as given")
    if unit.startswith("-") and known_unit(unit[1:]) and guess.column:
        column = f"({guess.column})" if "compute" in guess.options else quoted(guess.column)
        turned = f"-{column}={unit[1:]}"
        raise InputError(f"{guess.role}: a unit has no sign, but a formula has: --{guess.role} '{turned}'")
    known, factor = read_unit(unit)
    if known in ("", *COUNTS, *SECONDS):
        raise InputError(f"{guess.role}: unknown unit {unit!r}; of an encoder give =counts/N with N counts per turn")
    options = guess.options if factor == 1.0 else guess.options | {"scale": factor}
    return replace(guess, unit=known, options=options, written="")


def checked_formula(table: Table, role: str, said: Given, numbers: Iterable[str]) -> Expression:
    """Return the formula that the user gives for a signal; refused where it is none or names no column of numbers."""
    names = list(numbers)
    text = in_backquotes(said.column, names)
    if text == said.column and not Expression(text).columns:
        text = in_backquotes(text, names, numbers=True)
    if text != said.column:
        right = f"{text}={said.unit}" if said.unit else text
        raise InputError(
            f"{table.path}: in a formula the name of a column that is no plain word stands in backquotes:"
            f" --{role} '{right}'"
        )
    formula = Expression(text)
    missing = next((name for name in formula.columns if name not in names), None)
    if missing is not None or not formula.columns:
        raise InputError(
            f"{table.path}: no column {said.column!r} for the {role}; it has"
            f" {listed(names, 20)}{did_you_mean(said.column, names)}"
        )
    return formula


def quoted(name: str) -> str:
    """Name of a column as a formula has it."""
    return name if name.isidentifier() else f"`{name}`"
