"""Signals from the columns of a table."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.tables.mapped_signal import Signal, assignments, convert, make_signal
from idloop.records.tables.mapping import Channel, Mapping, Signals, Time
from idloop.records.tables.table_files import Table

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

# Files without a date start one second after the epoch: a stamp of zero means "no stamp" in ROS.
_START_NS = 1_000_000_000
_TO_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ABSOLUTE = 946_684_800.0  # 2000-01-01: larger times are dates, not seconds since the start
_LATEST_NS = 2**62  # in the year 2116: what is further away, on either side, is no time


def signals_from_table(table: Table, mapping: Mapping, signals: Signals) -> list[Signal]:
    """Read what the mapping assigns from the columns of a table."""
    if signals.time is None or signals.time.stamps is not None:
        raise InputError(
            f"mapping {mapping.name}: say where time comes from: `time: {{column: t}}` or `time: {{period: 0.001}}`"
        )
    raw: list[tuple[str, str, Channel, Floats]] = []
    for topic, field, channel in assignments(signals):
        if channel.column is None:
            raise InputError(
                f"mapping {mapping.name}: {topic} {field} names a topic, but {table.path} is a table; give `column:`"
            )
        if channel.optional and channel.column not in table:
            continue
        raw.append((topic, field, channel, convert(table.numbers(channel.column), table, channel)))
    if not raw:
        raise InputError(f"mapping {mapping.name}: it assigns no column; add `command:` and `position:` or `velocity:`")
    lengths = {str(channel.column): value.size for _, _, channel, value in raw}
    count = max(lengths.values())
    if min(lengths.values()) < count:
        text = ", ".join(f"{name}: {length}" for name, length in lengths.items())
        raise InputError(f"{table.path}: columns of unequal length ({text}); choose columns of one record")
    stamp = _time(table, signals.time, count)
    rows = slice(signals.rows.start, signals.rows.stop)
    if signals.rows.start >= count or (signals.rows.stop or 0) > count:
        raise InputError(
            f"{table.path}: rows {signals.rows.start} to {signals.rows.stop} do not lie within its {count} rows;"
            " mend `rows:`"
        )
    found = []
    for topic, field, channel, value in raw:
        found.append(make_signal(topic, field, channel, value[rows], (stamp[rows], stamp[rows]), signals, mapping))
    return found


def _time(table: Table, time: Time, count: int) -> Stamps:
    if time.column is None:
        period = time.period if time.period is not None else 1.0 / (time.rate or 1.0)
        if count * period * 1e9 >= _LATEST_NS:
            raise InputError(
                f"{table.path}: time: {count} rows at every {period:g} s last longer than any recording; mend"
                f" the {'period' if time.rate is None else 'rate'}"
            )
        return _START_NS + np.round(np.arange(count) * period * 1e9).astype(np.int64)
    if time.unit == "iso8601":
        stamp = np.array([_iso(table, cell, row) for row, cell in enumerate(table.raw(time.column))], dtype=object)
        stamp = _near(table, time.column, stamp)
    else:
        seconds = table.numbers(time.column)
        bad = np.flatnonzero(~np.isfinite(seconds))
        if bad.size:
            raise InputError(
                f"{table.path}: time column {time.column!r} is no number in row {bad[0]}; leave this row out with"
                " `rows:`"
            )
        with np.errstate(over="ignore"):
            whole = np.round(seconds if time.unit == "ns" else seconds * _TO_SECONDS[time.unit] * 1e9)
        stamp = _near(table, time.column, whole)
        if stamp.size and stamp.min() < _ABSOLUTE * 1e9:
            stamp = stamp + _START_NS - min(int(stamp[0]), 0)
    if stamp.size != count:
        raise InputError(
            f"{table.path}: time column {time.column!r} has {stamp.size} rows, the others {count}; choose columns"
            " of one record"
        )
    if stamp.size and stamp[0] < 0:
        raise InputError(f"{table.path}: time column {time.column!r} begins before 1970, which no stamp does")
    back = np.flatnonzero(np.diff(stamp) < 0)
    if back.size:
        raise InputError(
            f"{table.path}: time column {time.column!r} runs backwards in row {back[0] + 1}; cut the runs apart"
            " with `rows:`"
        )
    return stamp


def _near(table: Table, column: str | int, nanoseconds: NDArray[Any]) -> Stamps:
    """Times as stamps; InputError when one is out of reach of a stamp."""
    far = np.flatnonzero(np.abs(nanoseconds) >= _LATEST_NS)
    if far.size:
        raise InputError(
            f"{table.path}: time column {column!r} is {float(nanoseconds[far[0]]) / 1e9:g} s in row {far[0]}, which is"
            " no time; mend the file or leave this row out with `rows:`"
        )
    return nanoseconds.astype(np.int64)


def _iso(table: Table, cell: object, row: int) -> int:
    try:
        # Python 3.10 does not know the Z for UTC.
        when = datetime.fromisoformat(str(cell).strip().replace("Z", "+00:00"))
    except ValueError:
        raise InputError(
            f"{table.path}: row {row}: {str(cell)[:40]!r} is no ISO 8601 time; mend `time:` in the mapping"
        ) from None
    when = when if when.tzinfo else when.replace(tzinfo=timezone.utc)
    passed = when - datetime(1970, 1, 1, tzinfo=timezone.utc)
    return ((passed.days * 86_400 + passed.seconds) * 1_000_000 + passed.microseconds) * 1000
