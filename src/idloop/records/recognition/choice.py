"""What the columns of a table are taken for, while it is found out."""

from __future__ import annotations

from collections.abc import Mapping as Map
from dataclasses import dataclass, field, replace
from typing import Any

from idloop.records.recognition.guess import NONE, Given, Guess
from idloop.records.recognition.signal_units import SlopeOf, slope_of
from idloop.records.recognition.table_column import TableColumn
from idloop.records.recognition.time_base import TimeBase
from idloop.records.tables.table import Table


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
