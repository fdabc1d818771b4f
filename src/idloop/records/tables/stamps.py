"""Stamps of a table: dates, and single stamps that are wrong or missing among thousands that are not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Integers, Mask
from idloop.spelling import listed

_DATE = re.compile(
    r"(?P<date>\d{4}-\d\d-\d\d)(?:[T ](?P<clock>\d\d:\d\d(?::\d\d)?)(?:[.,](?P<part>\d{1,9})\d*)?"
    r"\s?(?:Z|UTC|GMT|(?P<sign>[-+])(?P<hours>\d\d):?(?P<minutes>\d\d)?)?)?"
)
# Usual steps that the stamps beside a wrong one may lie apart, and the share of rows that may be wrong: beyond it the
# column is no time that one can trust. Missing ones mislead less.
_APART, _MOST, _MOST_MISSING = 10.0, 0.01, 0.05


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
    return seconds * 1_000_000_000 + int((match["part"] or "0").ljust(9, "0"))


def dates_ns(cells: Iterable[Any]) -> Integers | None:
    """Return dates as nanoseconds since 1970, shape (n,); None where a cell is none, or there are no cells."""
    found = []
    for cell in cells:
        one = date_ns(cell)
        if one is None:
            return None
        found.append(one)
    return np.array(found, dtype=np.int64) if found else None


def bad_stamps(stamp: NDArray[Any]) -> Mask:
    """Find the rows whose stamp stands out of order between two that follow each other; none where they are too many.

    Where a time starts again, what follows is below what was before as well, and no single row stands out.

    `stamp` (n,): of any unit; NaN where there is none.
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
    return _unless_many(found, _MOST)


def missing_stamps(stamp: NDArray[Any]) -> Mask:
    """Find the rows without a stamp: none where they are too many, shape (n,)."""
    return _unless_many(~np.isfinite(stamp), _MOST_MISSING)


def _unless_many(found: Mask, most: float) -> Mask:
    return found if found.sum() <= most * found.size else np.zeros_like(found)


def in_order(stamp: NDArray[Any], bad: Mask) -> NDArray[Any]:
    """Return the stamps in order: each bad one as the one before it, or as the first good one."""
    first = int(np.argmin(bad)) if bad.size else 0
    return np.asarray(stamp[np.maximum.accumulate(np.where(bad, first, np.arange(stamp.size)))])


def without_bad_stamps(stamp: NDArray[Any], find: Any, first_row: int, notes: list[str]) -> tuple[NDArray[Any], Mask]:
    """Put the stamps that `missing_stamps` or `bad_stamps` finds in order, and note which rows an import leaves out."""
    found = find(stamp)
    if found.any():
        notes.append(_note(np.flatnonzero(found) + first_row, missing=find is missing_stamps))
        stamp = in_order(stamp, found)
    return stamp, found


def _note(rows: Sequence[int] | Integers, *, missing: bool) -> str:
    places = listed([str(row) for row in rows], 6)
    if len(rows) == 1:
        why = "it has no stamp" if missing else "its stamp stands out of order between those beside it"
        return f"row {places} is left out: {why}"
    why = "they have no stamp" if missing else "their stamps stand out of order between those beside them"
    return f"rows {places} are left out: {why}"
