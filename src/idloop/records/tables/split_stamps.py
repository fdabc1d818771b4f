"""Stamps in two columns, whole seconds and the rest, as ROS messages and C programs have them."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.tables.table import Table

_STAMP = "stamp"
_WHOLE = re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:secs?|seconds)", re.IGNORECASE)
_REST = {
    1e9: re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:nanosecs?|nsecs?|nanoseconds|ns)", re.IGNORECASE),
    1e6: re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:usecs?|microsecs?|microseconds|us)", re.IGNORECASE),
}
# Seconds since 1970 of the years 2000 to 2100, which a column without a name must hold.
_DATES = (9.5e8, 4.1e9)
_FEWEST = 3
_RISING = 0.97  # share of the steps of both together that are not negative
_FILLED = 0.5  # of its range, up to which a rest without a name goes


def join_stamps(table: Table) -> None:
    """Add a column with the stamps of which a table has the seconds and the rest in two columns side by side."""
    if table.clocks or _STAMP in table.columns:
        return
    for whole, rest in pairwise(table.columns):
        spans = _spans(whole, rest)
        first, second = (_counts(table, name) if spans else None for name in (whole, rest))
        if first is None or second is None or first.size != second.size:
            continue
        span = _span(spans, second, named=_WHOLE.fullmatch(whole) is not None)
        dates = _DATES[0] < float(first.min()) and float(first.max()) < _DATES[1]
        if not span or not (dates or _WHOLE.fullmatch(whole)):
            continue
        stamp = first + second / span
        if float(np.mean(np.diff(stamp) >= 0.0)) > _RISING and np.ptp(stamp) > 0.0:
            table.columns[_STAMP] = stamp
            table.units[_STAMP], table.stamp_parts = "s", (whole, rest)
            parts = "nanoseconds" if span == max(_REST) else "microseconds"
            table.notes.append(f"columns {whole!r} and {rest!r} are the seconds and {parts} of one time, {_STAMP!r}")
            return


def _spans(whole: str, rest: str) -> list[float]:
    """Parts of a second that the second of two columns may count, by their names; none where these are of others."""
    if _WHOLE.fullmatch(whole):
        return [span for span, name in _REST.items() if name.fullmatch(rest)]
    return sorted(_REST) if whole.isdigit() and rest.isdigit() else []


def _span(spans: list[float], rest: Array, *, named: bool) -> float:
    """The one that the values fit; 0 where none does. Without a name they must fill the range."""
    largest = float(rest.max())
    return next((span for span in spans if largest < span and (named or largest > _FILLED * span)), 0.0)


def _counts(table: Table, name: str) -> Array | None:
    """Values of a column of whole numbers from zero on; None for others."""
    try:
        value = table.numbers(name)
    except InputError:
        return None
    whole = np.isfinite(value).all() and (value >= 0.0).all() and (value == np.round(value)).all()
    return value if value.size >= _FEWEST and whole else None
