"""A finding made of its evidence and its cure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from idloop.arrays import Array, Integers
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis

Check = Callable[[Axis], list[Finding]]

# Places of a fault that are listed; the others are counted.
_PLACES = 200
# Evidence of how late the stamps of a command are [s], where nothing else is wrong with them.
LATE = "command_late"


def fault(
    kind: str,
    where: str,
    what: str,
    cure: str,
    *,
    evidence: Mapping[str, float] | None = None,
    spoils: Sequence[str] = (),
    level: Literal["note", "warning"] = "warning",
    count: int = 1,
    places: Sequence[tuple[float, float]] = (),
) -> Finding:
    """Return the finding whose text is what was seen, with its numbers, and what to do."""
    return Finding(
        kind=kind,
        text=f"{what}; {cure}",
        count=count,
        where=where,
        level=level,
        evidence=dict(evidence or {}),
        cure=cure,
        spoils=tuple(spoils),
        places=tuple(places[:_PLACES]),
    )


def around(time: Array, rows: Integers) -> list[tuple[float, float]]:
    """Return the intervals from the sample before to the one after each row [s]."""
    last = time.size - 1
    return [(float(time[max(k - 1, 0)]), float(time[min(k + 1, last)])) for k in rows[:_PLACES].tolist()]


def late_option(late: float) -> str:
    """Return the command that mends a command recorded late by so many seconds."""
    return f"`idloop start FILE --late {late:.4g}`"
