"""A finding made of its evidence and its cure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from idloop.arrays import Array, Integers
from idloop.records.finding import Finding

Places = Sequence[tuple[float, float]]

_PLACES = 200  # places of a fault that are listed; the others are counted
LATE = "command_late"  # evidence of how late the stamps of a command are [s], where nothing else is wrong with them


def fault(
    kind: str,
    where: str,
    what: str,
    cure: str,
    *,
    evidence: Mapping[str, float] | None = None,
    spoils: Sequence[str] = (),
    level: Literal["note", "warning"] = "warning",
    places: Places = (),
    count: int = 0,
) -> Finding:
    """Return the finding whose text is what was seen, with its numbers, and what to do; it counts its places."""
    return Finding(
        kind=kind,
        text=f"{what}; {cure}",
        count=count or max(len(places), 1),
        where=where,
        level=level,
        evidence={key: float(value) for key, value in (evidence or {}).items()},
        cure=cure,
        spoils=tuple(spoils),
        places=tuple(places[:_PLACES]),
    )


def around(time: Array, rows: Integers) -> Places:
    """Return the intervals from the sample before to the one after each row [s]."""
    last = time.size - 1
    return [(float(time[max(k - 1, 0)]), float(time[min(k + 1, last)])) for k in rows.tolist()]


def times(count: int) -> str:
    """Return "once", or how many times."""
    return "once" if count == 1 else f"{count} times"


def late_option(late: float) -> str:
    """Return the command that mends a command recorded late by so many seconds."""
    return f"`idloop start FILE --late {late:.4g}`"
