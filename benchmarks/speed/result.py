"""What a section of the benchmark finds: rows of measurements, and claims with what was reached."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Row:
    """One contestant at one piece of work.

    Attributes
    ----------
    work : str
        What was done; rows of the same work are compared.
    who : str
        Contestant; ``idloop`` is ours.
    seconds : float or None
        Median time; none where it could not be done.
    passed, processor : float or None
        Median of the time that passed and of processor time; `seconds` is the one that counts in this run.
    runs : int
        Runs behind the median.
    memory : float or None
        Peak above the interpreter, its libraries and the data [MB].
    answer : dict
        What shows that the work is right, by name.
    agrees : bool or None
        Whether the answer agrees with ours or with the truth; none where there is none to compare.
    note : str
        Why something is missing or different.
    """

    work: str
    who: str
    seconds: float | None = None
    runs: int = 0
    memory: float | None = None
    answer: dict[str, float] = field(default_factory=dict)
    agrees: bool | None = None
    note: str = ""
    passed: float | None = None
    processor: float | None = None


@dataclass
class Claim:
    """A target and what was reached.

    Attributes
    ----------
    text : str
        What is measured.
    target : float
    reached : float or None
        None where it could not be measured here.
    unit : str
        Of both: ``x`` for a ratio.
    at_least : bool
        Whether more is better.
    limit : str
        What limits it, where the target is missed.
    """

    text: str
    target: float
    reached: float | None
    unit: str = "x"
    at_least: bool = True
    limit: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is reached; none where nothing was measured."""
        if self.reached is None:
            return None
        return self.reached >= self.target if self.at_least else self.reached <= self.target


@dataclass
class Section:
    """All of one subject.

    Attributes
    ----------
    name, title : str
    rows : list of Row
    claims : list of Claim
    remarks : list of str
        How it was measured.
    shown : list of str
        Works that the picture shows; all of them where none is named.
    curves : dict
        Scaling curves: name to ``{"x": [...], "seconds": [...], "memory": [...], "label": ...}``.
    """

    name: str
    title: str
    rows: list[Row] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    curves: dict[str, dict[str, Any]] = field(default_factory=dict)
    shown: list[str] = field(default_factory=list)

    def find(self, work: str, who: str) -> Row | None:
        """Row of a contestant at a piece of work."""
        return next((row for row in self.rows if (row.work, row.who) == (work, who)), None)

    def ratio(self, work: str, who: str, ours: str = "idloop") -> float | None:
        """Time of a contestant over ours; none where one of the two is missing."""
        own, other = self.find(work, ours), self.find(work, who)
        if own is None or other is None or not own.seconds or other.seconds is None:
            return None
        return other.seconds / own.seconds
