"""One guess about a log, with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class Guess:
    """What a column is taken for.

    Attributes
    ----------
    role : str
        ``command``, ``position``, ``velocity``, ``effort``, ``reference``, ``reference velocity``, or the name of a
        condition.
    column : str
        Column or formula; empty where the value stands elsewhere, such as in the name of the file.
    unit : str
        As a mapping file writes it.
    reason : str
        Why this column, and why this unit.
    doubt : str
        What is uncertain and how to say otherwise; empty where nothing is.
    options : dict
        Further keys of the channel in the mapping: ``scale``, ``wrap``, ``decode``, ...
    measured : bool
        Whether the name says that a force, torque, current or voltage was measured.
    """

    role: str
    column: str
    unit: str
    reason: str
    doubt: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    measured: bool = False

    def with_doubt(self, doubt: str) -> Guess:
        """Return it with a further doubt."""
        return replace(self, doubt=f"{self.doubt}; {doubt}" if self.doubt else doubt)


@dataclass(frozen=True)
class Given:
    """What the user says of one role, and so is not guessed.

    Attributes
    ----------
    column : str
        Column or formula; empty where only the unit is given.
    unit : str
        Empty where not given; ``counts/4096`` is an encoder of 4096 counts per turn.
    """

    column: str = ""
    unit: str = ""

    @classmethod
    def parse(cls, text: str, columns: list[str]) -> Given:
        """Read ``COLUMN``, ``COLUMN=UNIT`` or ``=UNIT``."""
        if text in columns:
            return cls(text)
        column, equals, unit = text.rpartition("=")
        return cls(column.strip(), unit.strip()) if equals else cls(text.strip())
