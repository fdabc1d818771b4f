"""Tables in rows, with a row for each value, with stamps in two columns, or with stamps for each column."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import compress, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.tables.base_units import clock_unit
from idloop.records.tables.csv_layout import repeated
from idloop.records.tables.table import Table
from idloop.spelling import joined_names, listed

_MOST_SIGNALS, _FEWEST_SAMPLES = 64, 50
_LONGER = 10  # times as many columns as rows, of a table that is turned
_MOST_NAMES, _FEWEST_ROWS = 64, 10
_VALUES = {"value", "values", "varvalue", "val", "wert", "valor", "valeur", "valore", "waarde", "reading"}
_STAMP = "stamp"
_WHOLE = re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:secs?|seconds)", re.IGNORECASE)
_REST = {
    1e9: re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:nanosecs?|nsecs?|nanoseconds|ns)", re.IGNORECASE),
    1e6: re.compile(r"(?:^|.*[._\s])(?:tv_)?(?:usecs?|microsecs?|microseconds|us)", re.IGNORECASE),
}
# Seconds since 1970 of the years 2000 to 2100, which a column without a name must hold.
_DATES = (9.5e8, 4.1e9)
_FEWEST_STAMPS = 3
_HEADER = re.compile(r"(?<=[/.])header[/.]stamp$")
_LATEST = 10.0  # by which a message is received after its stamp [s]; clocks that are further apart are not one
_RISING = 0.97  # share of the steps of both together that are not negative
_FILLED = 0.5  # of its range, up to which a rest without a name goes


def turn_rows(table: Table) -> None:
    """Make each row a column where a text has few rows without a header and many columns; leave others alone."""
    count = max((len(column) for column in table.columns.values()), default=0)
    first, *others = table.columns.values()
    long = 0 < count <= _MOST_SIGNALS and len(others) >= max(_FEWEST_SAMPLES, _LONGER * count)
    has_header = list(table.columns) != list(map(str, range(len(table.columns))))
    whole = all(isinstance(column, np.ndarray) and column.size == count for column in others)
    named = not isinstance(first, np.ndarray)
    names = [str(cell).strip() for cell in first] if named else list(map(str, range(count)))
    if not long or has_header or not whole or len(set(names)) < count or not all(names):
        return
    rows = np.column_stack(others if named else [first, *others])
    table.columns = dict(zip(names, rows, strict=True))
    table.notes.append(f"each of its {count} rows is a signal{' with its name before it' if named else ''}")


def spread_names(table: Table) -> None:
    """Make each name of a table with a row for each value a column with the stamps of its rows; leave others alone."""
    found = _long(table)
    if found is None:
        return
    names, values, stamps = found
    label = _labels(table, names)
    when, what = np.asarray(table.columns[stamps]), np.asarray(table.columns[values], dtype=np.float64)
    series = {name: np.flatnonzero(label == name) for name in dict.fromkeys(label.tolist()) if name}
    unit = table.units.get(stamps, "") or clock_unit(stamps) or ""
    table.units = {}
    table.set_series({name: (when[rows], what[rows]) for name, rows in series.items()}, stamps, unit)
    said = f"{joined_names(list(map(repr, names)))} {'name' if len(names) > 1 else 'names'} it"
    table.notes.append(
        f"each row holds one value: {said} ({listed(list(series), 6)}), {values!r} is it, {stamps!r} is its time"
    )


def _labels(table: Table, names: list[str]) -> NDArray[Any]:
    """Name of the signal of each row, of several columns the names in a row."""
    return np.array([".".join(str(cell).strip() for cell in row) for row in zip(*map(table.raw, names), strict=True)])


def _long(table: Table) -> tuple[list[str], str, str] | None:
    """Columns of the names, of the values and of the stamps of a table with a row for each value; None for others."""
    times = [name for name in table.columns if clock_unit(name) is not None]
    texts = {
        name: column
        for name, column in table.columns.items()
        if name not in times and len(column) and all(isinstance(cell, str) for cell in column)
    }
    names = [name for name, column in texts.items() if _are_names(column)]
    if not names or not times:
        return None
    label = _labels(table, names)
    # A topic and a path within it name a signal together; a state that changes by itself is none of it.
    if len(set(label.tolist())) > max(len(set(texts[name])) for name in names):
        return None
    free = [
        name
        for name, column in table.columns.items()
        if isinstance(column, np.ndarray) and name not in times and _varies(column, label)
    ]
    said = [name for name in free if name.strip("_ ").lower() in _VALUES]
    # Phases of one run follow each other; values of several signals have stamps in common.
    together = any(count > 1 for count in Counter(np.asarray(table.columns[times[0]]).tolist()).values())
    values = said or (free if together else [])
    return (names, values[0], times[0]) if len(values) == 1 else None


def _are_names(column: list[str]) -> bool:
    counts = Counter(cell.strip() for cell in column)
    return 2 <= len(counts) <= _MOST_NAMES and min(counts.values()) >= _FEWEST_ROWS and all(counts)


def _varies(column: Array, label: NDArray[Any]) -> bool:
    """Whether a column changes among the rows of one name."""
    if column.dtype.kind not in "fiu":
        return False
    known = np.isfinite(column)
    return any(
        float(np.ptp(column[rows])) > 0.0 for one in set(label.tolist()) if (rows := (label == one) & known).any()
    )


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


def take_header_stamps(table: Table) -> None:
    """Give the columns of a topic the stamps of its header, in a table with a row for each message received.

    The time of reception varies by the load of the network and of the recorder. Columns without a header keep it. As
    PlotJuggler writes tables of ROS: `__time`, `/joint_states/header/stamp`, `/joint_states/elbow/position`.
    """
    stamps = {name[: match.start()]: name for name in table.columns if (match := _HEADER.search(name))}
    received = next((name for name in table.columns if clock_unit(name.strip("_")) is not None), "")
    if table.clocks or not stamps or received in ("", *stamps.values()):
        return
    try:
        numbers = {name: table.numbers(name) for name in table.columns}
    except InputError:
        return
    when = numbers.pop(received)
    if not np.isfinite(when).all() or not all(_are_stamps(numbers[name], when) for name in stamps.values()):
        return
    clocks = {name: numbers.pop(name) for name in stamps.values()}
    unit = table.units.get(received, "") or "s"
    rows = {name: np.isfinite(clock) for name, clock in clocks.items()}
    table.columns = {name: clock[rows[name]] for name, clock in clocks.items()}
    table.units |= dict.fromkeys(clocks, unit)
    for name, value in numbers.items():
        known = np.isfinite(value)
        own = next((stamp for topic, stamp in stamps.items() if name.startswith(topic)), "")
        if own and not (known & ~rows[own]).any():
            table.columns[name], table.clocks[name] = value[rows[own]], own
        elif known.any():
            table.add_series(name, when[known], value[known], unit, received)
    late = f", and not the times {received!r} of their reception"
    table.notes.append(f"columns beside the stamps of a header have these: {listed(clocks)}{late}")


def _are_stamps(stamp: Array, received: Array) -> bool:
    """Whether stamps are those of some of the messages that were received, on the same clock."""
    known = np.isfinite(stamp)
    if known.all() or known.sum() < _FEWEST_ROWS:
        return False
    rises = float(np.mean(np.diff(stamp[known]) > 0.0)) > _RISING
    return rises and float(np.abs(stamp[known] - received[known]).max()) < _LATEST


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
    return value if value.size >= _FEWEST_STAMPS and whole else None


def clocks_of(names: Sequence[str]) -> dict[int, int]:
    """Return the column with the stamps of each, by places, where several of one name hold stamps."""
    stamps = [name for name in repeated(names) if clock_unit(name) is not None]
    found: dict[int, int] = {}
    clock = None
    for place, name in enumerate(map(str.strip, names)):
        if name in stamps:
            clock = place
        elif clock is not None:
            found[place] = clock
    return found


def numbered(names: Iterable[str]) -> list[str]:
    """Return names of which each but the first of its kind has its number behind it."""
    before: Counter[str] = Counter()
    found = []
    for name in names:
        before[name] += 1
        found.append(f"{name} ({before[name]})" if before[name] > 1 else name)
    return found


def are_alike(columns: Sequence[Any]) -> bool:
    """Whether columns of stamps, (n,) or lists of texts, are all the same."""
    first, *others = columns
    if all(isinstance(one, np.ndarray) for one in columns):
        return all(np.array_equal(first, other, equal_nan=True) for other in others)
    return all(list(first) == list(other) for other in others)


def cut_at_ends(columns: dict[str, Any], clocks: Mapping[str, str]) -> None:
    """Cut each column where its stamps end: what was read less often than the others ends in empty cells."""
    for clock in set(clocks.values()):
        stamps = columns[clock]
        texts = not isinstance(stamps, np.ndarray)
        known = np.array([bool(str(cell).strip()) for cell in stamps]) if texts else np.isfinite(stamps)
        for name in (clock, *(name for name, own in clocks.items() if own == clock)):
            column = columns[name]
            columns[name] = column[known] if isinstance(column, np.ndarray) else list(compress(column, known))
