"""What redoing a row of a paper gives: a table "quantity | ours | paper | claimed", further tables, and a figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from idloop.reporting.text import blocks
from papers.claim import Claim

Cell = float | str | None
_HOLDS = {True: "yes", False: "NO", None: ""}


@dataclass(frozen=True)
class Line:
    """One quantity beside the paper's.

    Attributes
    ----------
    quantity : str
    ours : float, str or None
        Computed, measured on a simulated machine, or in words.
    paper : float, str or None
        Published; None where the paper says nothing.
    unit : str
        Of both numbers; empty for words and pure numbers.
    source : str
        Place in the paper.
    claim : Claim or None
        What must be so of ours for the line to hold; None where nothing is claimed.
    """

    quantity: str
    ours: Cell
    paper: Cell = None
    unit: str = ""
    source: str = ""
    claim: Claim | None = None

    @property
    def holds(self) -> bool | None:
        """Whether ours is as claimed; None where nothing is claimed."""
        return None if self.claim is None else self.claim.met(self.ours)

    @property
    def claimed(self) -> str | None:
        """The claim in words; None where nothing is claimed."""
        return None if self.claim is None else self.claim.words(self.unit)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "quantity": self.quantity,
            "ours": self.ours,
            "paper": self.paper,
            "unit": self.unit,
            "source": self.source,
            "claim": self.claimed,
            "holds": self.holds,
        }


@dataclass(frozen=True)
class Table:
    """A further table.

    Attributes
    ----------
    title : str
    header : sequence of str
        With units.
    rows : sequence of sequence of float, str or None
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"title": self.title, "header": list(self.header), "rows": [list(row) for row in self.rows]}


class Reproduction(ABC):
    """A row of a paper, redone. Each row has a frozen dataclass of its own."""

    @abstractmethod
    def rows(self) -> tuple[Line, ...]:
        """The table "quantity | ours | paper | claimed"."""

    @abstractmethod
    def plot(self, axes: Any = None) -> Any:
        """Draw the row's figure; returns the matplotlib axes."""

    def tables(self) -> tuple[Table, ...]:
        """Further tables; none by default."""
        return ()

    def notes(self) -> tuple[str, ...]:
        """What a reader should know, one sentence or two each."""
        return ()

    def blocks(self) -> Iterator[blocks.Block]:
        """Yield the table "quantity | ours | paper | claimed", the further tables and the notes."""
        rows = []
        for line in self.rows():
            quantity = f"{line.quantity} [{line.unit}]" if line.unit else line.quantity
            values = (_text(line.ours), _text(line.paper))
            rows.append((quantity, *values, line.source, line.claimed or "", _HOLDS[line.holds]))
        yield blocks.Table.of(["quantity", "ours", "paper", "source", "claimed", "holds"], rows)
        for table in self.tables():
            yield from ("", table.title, blocks.Table.of(table.header, [map(_text, row) for row in table.rows]))
        yield from ("", *(f"- {note}" for note in self.notes())) if self.notes() else ()

    @property
    def holds(self) -> bool:
        """Whether no line is missed."""
        return all(line.holds is not False for line in self.rows())

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "holds": self.holds,
            "rows": [line.to_dict() for line in self.rows()],
            "tables": [table.to_dict() for table in self.tables()],
            "notes": list(self.notes()),
        }


def _text(value: Cell) -> str:
    """Text of a cell: five digits of a number, words as they are."""
    return value if isinstance(value, str) else blocks.number(value, 5)
