"""Dates with their time of day, as ISO 8601 writes them and as programs print them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime, timezone
from typing import Any

import numpy as np

from idloop.arrays import Integers

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
