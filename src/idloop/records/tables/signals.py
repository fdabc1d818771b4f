"""Signals of a table or a foreign bag, as a mapping assigns and converts them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.read import read_streams
from idloop.records.bags.topics import resolve_topic, topics_named
from idloop.records.measured_conditions import FIELD
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.tables.base_units import SECONDS, base_unit, known_clock_unit
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.expression import Expression
from idloop.records.tables.mapping import Channel, Mapping, Signals, SignBit, Time
from idloop.records.tables.stamps import bad_stamps, date_ns, missing_stamps, without_bad_stamps
from idloop.records.tables.table import Table
from idloop.records.unwrapping import unwrap

Stamps = NDArray[np.int64]

# Files without a date start one second after the epoch: a stamp of zero means "no stamp" in ROS.
_START_NS = 1_000_000_000
_ABSOLUTE = 946_684_800.0  # 2000-01-01: larger times are dates, not seconds since the start
_LATEST_NS = 2**62  # in the year 2116: numbers of larger size are not times
_BITS = {"int8": 8, "int16": 16, "int32": 32}
_OF_ONE_RECORD = "; choose columns of one record"


@dataclass(frozen=True)
class Signal:
    """One channel read: where it goes, its stamps and values."""

    topic: str
    joint: str
    field: str
    unit: str
    stamp_ns: Stamps
    receive_ns: Stamps
    value: Array
    # Start and length [s] of the gaps over which the number of turns of an unwrapped position is a guess
    doubtful: tuple[tuple[float, float], ...] = ()

    @property
    def name(self) -> str:
        """Topic, joint and field, such as ``joint_command motor.effort``."""
        return f"{self.topic} {self.joint}.{self.field}"


def signals_from_table(table: Table, mapping: Mapping, signals: Signals) -> list[Signal]:
    """Read what the mapping assigns from the columns of a table; rows outside of its `rows` are not looked at."""
    start, stop = signals.rows.start, signals.rows.stop
    rows = slice(start - table.first_row, None if stop is None else stop - table.first_row)
    raw: list[tuple[str, str, Channel, Time | None, Array]] = []
    for topic, field, channel in _assignments(signals):
        if channel.topic is not None:
            raise InputError(
                f"mapping {mapping.name}: {topic} {field} names a topic, but {table.path} is a table; give `column:`"
            )
        if channel.optional and channel.column is not None and channel.column not in table:
            continue
        raw.append((topic, field, channel, _clock(table, signals, channel), _values(table, channel, rows)))
    if not any(value.ndim for *_, value in raw):
        raise InputError(f"mapping {mapping.name}: it assigns no column; add `command:` and `position:` or `velocity:`")
    # What has no column, such as a constant command, has the stamps of the first that has one.
    first = next(time for *_, time, value in raw if value.ndim)
    stamps: dict[Time | None, tuple[Stamps, Mask]] = {}
    for time in dict.fromkeys(time if value.ndim else first for *_, time, value in raw):
        if time is None or time.stamps is not None:
            raise InputError(
                f"mapping {mapping.name}: say where time comes from: `time: {{column: t}}` or `time: {{period: 0.001}}`"
            )
        columns = [(one, value.size) for *_, one, own, value in raw if own == time and value.ndim]
        sizes = {str(one.compute if one.column is None else one.column): size for one, size in columns}
        _check_sizes(table, sizes, _OF_ONE_RECORD)
        stamps[time] = _time(table, time, max(sizes.values()), rows)
    shift = _shift([stamp for stamp, _ in stamps.values()])
    found = []
    for topic, field, channel, time, value in raw:
        stamp, bad = stamps[first if not value.ndim or time is None else time]
        kept = _within(stamp, signals, held=channel.time is not None and _is_held(topic)) & ~bad
        values = np.broadcast_to(value, stamp.shape)[kept]
        found.append(_make_signal(topic, field, channel, values, (stamp[kept] + shift,) * 2, mapping))
    return found


def _check_sizes(table: Table, sizes: dict[str, int], advice: str) -> None:
    if len(set(sizes.values())) > 1:
        text = ", ".join(f"{name}: {size}" for name, size in sizes.items())
        raise InputError(f"{table.path}: columns of unequal length ({text}){advice}")


def _clock(table: Table, signals: Signals, channel: Channel) -> Time | None:
    """Where the stamps of a column come from: its own, those of the mapping, or those that the file says."""
    if channel.time is not None or signals.time is not None:
        return channel.time or signals.time
    name = channel.column if isinstance(channel.column, str) else None
    if name is None and channel.compute is not None:
        name = next(iter(Expression(channel.compute).columns), None)
    if name not in table.clocks:
        return None
    clock = table.clocks[name]
    unit = known_clock_unit(table.units.get(clock, "s"))
    if not unit:
        raise InputError(
            f"{table.path}: {clock!r} is in {table.units[clock]!r}; give `time:` with its unit in the mapping"
        )
    return Time(column=clock, unit=unit)


def _values(table: Table, channel: Channel, rows: slice) -> Array:
    """Values of one channel, shape (n,); of a constant a single one, shape ()."""
    if channel.is_constant:
        return np.asarray(_constant(table, channel) * channel.scale + channel.offset)
    if channel.compute is None:
        return _convert(_column(table, channel.column, rows), table, channel, rows)  # type: ignore[arg-type]
    formula = Expression(channel.compute)
    columns = {name: _column(table, name, rows) for name in formula.columns}
    _check_sizes(table, {name: value.size for name, value in columns.items()}, f" in {channel.compute!r}")
    if not columns:
        raise InputError(f"{table.path}: {channel.compute!r} names no column; give a constant as `value:`")
    return _convert(formula.evaluate(columns), table, channel, rows)


def _constant(table: Table, channel: Channel) -> float:
    if channel.value is not None:
        return channel.value
    match = re.search(str(channel.file_name), table.path.name)
    number = match[1].replace(",", ".") if match else ""
    if not is_number(number):
        raise InputError(
            f"{table.path}: no number in the name of the file by {channel.file_name!r}; correct `file_name:`, or give"
            " `value:`"
        )
    return float(number)


def _column(table: Table, name: str | int, rows: slice) -> Array:
    """Return the selected rows of a column; InputError where they do not lie within it."""
    count = table.first_row + len(table.raw(name))
    start, stop = rows.start + table.first_row, None if rows.stop is None else rows.stop + table.first_row
    if start >= count or (stop or 0) > count:
        raise InputError(f"{table.path}: rows {start} to {stop} do not lie within its {count} rows; correct `rows:`")
    return table.numbers(name, rows)


def _is_held(topic: str) -> bool:
    return topic not in ("joint_states", CONDITIONS)


def _moved(stamp: Stamps, time: Time) -> Stamps:
    """Return the stamps of a clock that began at another time, or ran at another rate, as they should be."""
    if not stamp.size or not (time.offset or time.stretch != 1.0):
        return stamp
    passed = np.round((stamp - stamp[0]) * time.stretch).astype(np.int64)
    return np.asarray(stamp[0] + passed + round(time.offset * 1e9))


def _within(stamp: Stamps, signals: Signals, *, held: bool) -> Mask:
    """Which stamps [ns] lie within the times that the mapping selects; of a held signal the last one before, too."""
    start, stop = signals.times.start, signals.times.stop
    kept = np.ones(stamp.size, dtype=bool)
    if stop is not None:
        kept &= stamp < round(stop * 1e9)
    if start is not None:
        begin = np.searchsorted(stamp, round(start * 1e9))
        kept[: max(int(begin) - int(held), 0)] = False
    return kept


def signals_from_bag(source: Path, mapping: Mapping, signals: Signals) -> list[Signal]:
    """Read what the mapping assigns from the topics of a bag."""
    assigned = _assignments(signals)
    with Bag(source, definitions=mapping.definitions) as bag:
        known = bag.topics
        names = {}
        for topic, field, channel in assigned:
            if channel.topic is None:
                raise InputError(
                    f"mapping {mapping.name}: {topic} {field} names a column, but {source} is a bag; give"
                    " `topic:` and `field:`"
                )
            if channel.times is not None:
                raise InputError(
                    f"mapping {mapping.name}: {topic} {field}: `times: {channel.times}` names a column, but {source} is"
                    " a bag; multiply by `scale:`"
                )
            if channel.optional and not topics_named(channel.topic, known):
                continue
            names[channel.topic] = resolve_topic(channel.topic, known, source)
        streams = read_streams(bag, set(names.values()))
    read = []
    for topic, field, channel in assigned:
        if channel.topic not in names:
            continue
        stream, time = streams[names[channel.topic]], channel.time or signals.time or Time(stamps="header")
        if time.stamps is None:
            raise InputError(
                f"mapping {mapping.name}: {source} is a bag, whose messages have stamps of their own: give"
                " `time: {stamps: header}` or `time: {stamps: receive}`"
            )
        stamp = _moved(stream.receive_ns if time.stamps == "receive" else stream.stamp_ns, time)
        read.append((topic, field, channel, stream, (stamp, _moved(stream.receive_ns, time))))
    if not read:
        raise InputError(f"mapping {mapping.name}: it assigns no topic; add `command:` and `position:` or `velocity:`")
    begin = min((int(stamp.min()) for *_, (stamp, _) in read if stamp.size), default=0)
    found = []
    for topic, field, channel, stream, (stamp, receive) in read:
        kept = _within(stamp - begin, signals, held=_is_held(topic))
        value = _convert(stream.number(channel.source_joint or "", channel.field or ""), None, channel)
        found.append(_make_signal(topic, field, channel, value[kept], (stamp[kept], receive[kept]), mapping))
    return found


def _assignments(signals: Signals) -> list[tuple[str, str, Channel]]:
    """Return (topic, field, channel) for everything that the mapping assigns, each channel with its joint."""
    assigned = [
        ("reference", "position", signals.reference.position),
        ("reference", "velocity", signals.reference.velocity),
        ("excitation", "position", signals.excitation.position),
        ("excitation", "effort", signals.excitation.effort),
        ("joint_states", "position", signals.position),
        ("joint_states", "velocity", signals.velocity),
        ("joint_states", "effort", signals.effort),
        ("joint_command", "effort", signals.command),
    ]
    found = [(topic, field, one, one.joint or signals.joint) for topic, field, several in assigned for one in several]
    found += [(CONDITIONS, FIELD, one, name) for name, one in signals.conditions.items()]
    return [(topic, field, one.model_copy(update={"joint": joint})) for topic, field, one, joint in found]


def _make_signal(
    topic: str, field: str, channel: Channel, value: Array, stamps: tuple[Stamps, Stamps], mapping: Mapping
) -> Signal:
    """Return converted values as a signal: unwrapped where a range is declared, in the unit of the topic."""
    joint = channel.joint
    if not joint:
        raise InputError(f"mapping {mapping.name}: no joint named; add `joint: motor` at the top")
    doubtful: tuple[tuple[float, float], ...] = ()
    if channel.wrap is not None:
        found = unwrap((stamps[0] - stamps[0][:1].sum()) * 1e-9, value, channel.wrap)
        value, doubtful = found.value, found.doubtful
    kind, what = ("condition", joint) if topic == CONDITIONS else (field, field)
    unit, factor = base_unit(channel.unit, kind, f"mapping {mapping.name}: {topic} {what}")
    return Signal(topic, joint, field, unit, *stamps, value if factor == 1.0 else value * factor, doubtful)


def _convert(value: Array, table: Table | None, channel: Channel, rows: slice = slice(0, None)) -> Array:
    """Return decode(raw) * scale * times + offset."""
    if isinstance(channel.decode, SignBit):
        value = sign_magnitude(value, channel.decode.sign_bit)
    elif channel.decode is not None:
        value = twos_complement(value, channel.decode)
    value = value * channel.scale
    if channel.times is not None and table is not None:
        factor = table.numbers(channel.times, rows)
        sizes = {str(channel.times): factor.size, str(channel.column or channel.compute): value.size}
        _check_sizes(table, sizes, _OF_ONE_RECORD)
        value = value * factor
    return value + channel.offset


def _time(table: Table, time: Time, count: int, rows: slice) -> tuple[Stamps, Mask]:
    """Stamps of the selected rows as the file counts them [ns], and which rows are left out for theirs."""
    first = rows.start + table.first_row
    name = time.source
    if name is None:
        period = time.period if time.period is not None else 1.0 / (time.rate or 1.0)
        if (first + count) * period * 1e9 >= _LATEST_NS:
            raise InputError(
                f"{table.path}: time: {count} rows at every {period:g} s last longer than any recording;"
                f" correct the {'period' if time.rate is None else 'rate'}"
            )
        stamp = np.asarray(np.round(np.arange(first, first + count) * period * 1e9).astype(np.int64))
        return stamp, np.zeros(count, dtype=bool)
    missing = np.zeros(count, dtype=bool)
    if time.unit == "iso8601":
        dates = [(cell, date_ns(cell)) for cell in table.raw(name)[rows]]
        none = next((row for row, (_, date) in enumerate(dates) if date is None), None)
        if none is not None:
            raise InputError(
                f"{table.path}: row {first + none}: {str(dates[none][0])[:40]!r} is not an ISO 8601 time; correct"
                " `time:` in the mapping"
            )
        stamp = _as_stamps(table, name, np.array([date for _, date in dates], dtype=object), first)
    else:
        seconds, missing = without_bad_stamps(time.read(table, rows), missing_stamps, first, table.notes)
        bad = np.flatnonzero(~np.isfinite(seconds))
        if bad.size:
            raise InputError(
                f"{table.path}: time column {name!r} is not a number in row {first + bad[0]}; leave this row out"
                " with `rows:`"
            )
        with np.errstate(over="ignore"):
            whole = np.round(seconds if time.unit == "ns" else seconds * SECONDS[time.unit] * 1e9)
        stamp = _to_known_digits(_as_stamps(table, name, whole, first), seconds, time.unit)
    stamp = _moved(stamp, time)
    _check_sizes(table, {f"time {name}": stamp.size, "others": count}, _OF_ONE_RECORD)
    stamp, wrong = without_bad_stamps(stamp, bad_stamps, first, table.notes)
    back = np.flatnonzero(np.diff(stamp) < 0)
    if back.size:
        raise InputError(
            f"{table.path}: time column {name!r} runs backwards in row {first + back[0] + 1}; cut the runs apart"
            " with `rows:`"
        )
    if stamp.size and time.unit == "iso8601" and stamp[0] < 0:
        raise InputError(f"{table.path}: time column {name!r} begins before 1970; stamps begin there")
    return stamp, wrong | missing


def _to_known_digits(stamp: Stamps, read: Array, unit: str) -> Stamps:
    """Round stamps to the digits that double precision keeps: of a date in seconds those of microseconds.

    What is left below them is no time, and makes even stamps uneven.
    """
    apart = float(np.spacing(np.max(np.abs(read), initial=0.0))) * SECONDS[unit] * 1e9
    if unit == "ns" or apart < 1.0:
        return stamp
    digit = 10 ** int(np.ceil(np.log10(apart)))
    return np.asarray((stamp + digit // 2) // digit * digit)


def _shift(stamps: list[Stamps]) -> int:
    """What is added to all stamps [ns]: times since the start begin one second after the epoch, dates stay."""
    earliest = min(int(stamp[0]) for stamp in stamps if stamp.size)
    return _START_NS - min(earliest, 0) if earliest < _ABSOLUTE * 1e9 else 0


def _as_stamps(table: Table, column: str | int, nanoseconds: NDArray[Any], first: int) -> Stamps:
    """Times as stamps; InputError when one is outside the range of stamps."""
    far = np.flatnonzero(np.abs(nanoseconds) >= _LATEST_NS)
    if far.size:
        raise InputError(
            f"{table.path}: time column {column!r} is {float(nanoseconds[far[0]]) / 1e9:g} s in row {first + far[0]},"
            " which is not a time; correct the file or leave this row out with `rows:`"
        )
    return nanoseconds.astype(np.int64)


def twos_complement(raw: Array, kind: str) -> Array:
    """Read unsigned values as two's complement of 8, 16 or 32 bits (65535 of int16 is -1); NaN stays NaN.

    Values that are negative already pass unchanged.
    """
    span = 2.0 ** _BITS[kind]
    _check_integers(raw, span, kind)
    return np.where(raw >= span / 2, raw - span, raw)


def sign_magnitude(raw: Array, sign_bit: int) -> Array:
    """Read values whose bit `sign_bit` (from 0) means negative, the bits below being the magnitude; NaN stays NaN."""
    sign = 2.0**sign_bit
    _check_integers(raw, 2 * sign, f"sign bit {sign_bit}")
    return np.where(raw >= sign, -(raw - sign), raw)


def _check_integers(raw: Array, span: float, what: str) -> None:
    known = raw[np.isfinite(raw)]
    if np.any(known != np.round(known)) or np.any(np.abs(known) >= span):
        bad = known[(known != np.round(known)) | (np.abs(known) >= span)][0]
        raise InputError(
            f"decode {what}: value {bad:g} is no such integer; check `column:` and `decode:` of the mapping"
        )
