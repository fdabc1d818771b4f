"""Stamps of a table: dates, single stamps that are wrong or missing, and stamps in two columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Integers, Mask
from idloop.spelling import listed

# Usual steps that the stamps beside a wrong one may lie apart, and the share of rows that may be wrong: beyond it the
# column is no time that one can trust. Missing ones mislead less.
_APART, _MOST, _MOST_MISSING = 10.0, 0.01, 0.05


def bad_stamps(stamp: NDArray[Any]) -> Mask:
    """Find the rows whose stamp stands out of order between two that follow each other.

    Where a time starts again, what follows is below what was before as well, and no single row stands out.

    `stamp` (n,): of any unit; NaN where there is none.
    Returns shape (n,): None of them where they are too many.
    """
    found = np.zeros(stamp.size, dtype=bool)
    step = np.diff(stamp)
    forward = step[step > 0]
    if forward.size < 3:
        return found
    limit = _APART * float(np.median(forward))
    for row in np.flatnonzero(step < 0) + 1:
        # Either the row is too early, or the one before it is too late.
        for wrong in (row, row - 1):
            if 0 < wrong < stamp.size - 1 and 0 <= stamp[wrong + 1] - stamp[wrong - 1] <= limit:
                found[wrong] = not found[wrong - 1]
                break
    return found if found.sum() <= _MOST * stamp.size else np.zeros(stamp.size, dtype=bool)


def in_order(stamp: NDArray[Any], bad: Mask) -> NDArray[Any]:
    """Return the stamps with each bad one as the one before it, so that the rows stay in order.

    Those before the first good one are as that one.
    """
    first = int(np.argmin(bad)) if bad.size else 0
    return np.asarray(stamp[np.maximum.accumulate(np.where(bad, first, np.arange(stamp.size)))])


def missing_stamps(stamp: NDArray[Any]) -> Mask:
    """Find the rows without a stamp: none where they are too many, shape (n,)."""
    found = ~np.isfinite(stamp)
    return found if found.sum() <= _MOST_MISSING * stamp.size else np.zeros(stamp.size, dtype=bool)


def note_missing_stamps(rows: Sequence[int] | Integers) -> str:
    """Say which rows are left out, counted from 0."""
    places = listed([str(row) for row in rows], 6)
    return (
        f"row {places} is left out: it has no stamp"
        if len(rows) == 1
        else (f"rows {places} are left out: they have no stamp")
    )


def note_bad_stamps(rows: Sequence[int] | Integers) -> str:
    """Say which rows are left out, counted from 0."""
    places = listed([str(row) for row in rows], 6)
    if len(rows) == 1:
        return f"row {places} is left out: its stamp stands out of order between those beside it"
    return f"rows {places} are left out: their stamps stand out of order between those beside them"


_DATE = re.compile(
    r"(?P<date>\d{4}-\d\d-\d\d)(?:[T ](?P<clock>\d\d:\d\d(?::\d\d)?)(?:[.,](?P<part>\d{1,9})\d*)?"
    r"\s?(?:Z|UTC|GMT|(?P<sign>[-+])(?P<hours>\d\d):?(?P<minutes>\d\d)?)?)?"
)
_SECOND = 1_000_000_000


def date_ns(cell: Any) -> int | None:
    """Return a date as nanoseconds since 1970 in UTC; None where it is none. One without a zone is taken as UTC.

    `cell`: ``2025-03-02 09:00:00.25``, ``2025-03-02T09:00:00,25+0100``.
    """
    match = _DATE.fullmatch(str(cell).strip())
    if match is None:
        return None
    try:
        when = datetime.fromisoformat(f"{match['date']}T{match['clock'] or '00:00'}").replace(tzinfo=timezone.utc)
    except ValueError:
        return None
    seconds = round(when.timestamp())
    if match["sign"]:
        ahead = 3600 * int(match["hours"]) + 60 * int(match["minutes"] or 0)
        seconds -= ahead if match["sign"] == "+" else -ahead
    return seconds * _SECOND + int((match["part"] or "0").ljust(9, "0"))


def dates_ns(cells: Iterable[Any]) -> Integers | None:
    """Return dates as nanoseconds since 1970, shape (n,); None where a cell is none, or there are no cells."""
    found = []
    for cell in cells:
        one = date_ns(cell)
        if one is None:
            return None
        found.append(one)
    return np.array(found, dtype=np.int64) if found else None
