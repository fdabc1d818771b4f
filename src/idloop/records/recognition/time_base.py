"""The time column of a table, its unit, and the runs between which it starts again."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.recognition.column_name import is_counter, name_in
from idloop.records.recognition.guess import Given, checked_formula, quoted
from idloop.records.recognition.roles import RoleByName, role_by_name
from idloop.records.tables.base_units import SECONDS, known_unit
from idloop.records.tables.expression import Expression
from idloop.records.tables.mapping import Time
from idloop.records.tables.stamps import dates_ns
from idloop.records.tables.table import Table
from idloop.spelling import listed

# Sampling periods of servo axes [s]: units that give others are improbable.
_SHORTEST, _LONGEST = 4e-5, 0.12
_SLOWEST = 1.5  # that a log may have, of steady states or of a printed line per second
_FINE = 0.5  # steps of a clock with decimals below which it counts seconds rather than milliseconds
# A date in each unit: between the years 2000 and 2100.
_DATES = (9.5e8, 4.1e9)
_RISING = 0.5  # share of the steps of a named time column that are not negative: it may start again often
_EVEN = 0.97  # share of the steps of a column without a name that are nearly equal
# "TM=1000us" in the name of a column that counts the samples.
_IN_NAME = re.compile(r"=\s*(\d+(?:[.,]\d+)?)\s*([µa-z]+)", re.IGNORECASE)
_FEWEST_ROWS, _FEWEST_STAMPS = 10, 3
_DECIMATED = 1.5  # periods that rows are apart at least where others between them were left out
_NEAR = 0.05  # of its range, in which a time starts again
_SAME = 0.02  # difference of two periods that agree
# A given time starts again at each run, and may stand where stamps are rounded.
_MOST_FALLS, _FEWEST_RISES = 0.1, 0.05
# Names of a position that may be those of a clock: the axis of a plot, ticks of a timer.
_TICK_WORDS = {"tick", "ticks"}
_INTERVAL_WORDS = {"dt", "delta", "interval", "period"}
_AROUND = 0.5  # spread of the time between rows, as a share of it
_OF_CLOCKS = {"x", "count", "counts", *_TICK_WORDS}
_BACKWARDS = "runs backwards: turn the order of the rows"
_WAYS = "numbers nor times such as 10:03:29.5 or 2025-11-12T10:03:29.5"
# Names whose one value is the sampling period [s]: of oscilloscopes, and beside arrays.
_INCREMENTS = {
    "increment", "xincrement", "x increment", "sample interval", "delta_x", "dt", "ts", "sample_time", "sampling_time",
    "sampling_period", "sample_period",
}  # fmt: skip
# Names whose one value is the rate [Hz].
_RATE = re.compile(r"fs|((sampl(e|ing)|control|action|data|log(ging)?|update)_?)?(rate|frequency|freq|hz)(_hz)?")


def _stated(what: str) -> re.Pattern[str]:
    """Notes above a table that say how long something takes: "Sampling period [ms];1", "100 us per tick"."""
    number = r"(?P<{}>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
    behind = rf"(?:{what})(?:\b|_)[^0-9]*?(?:\[(?P<before>[^\]]+)\][^0-9]*)?{number.format('number')}"
    per = rf"{number.format('times')}\s*(?P<of>[µa-zA-Z]+)\s*(?:per|/)\s*(?:{what})\b"
    return re.compile(rf"{per}|{behind}[\s,;\[(]*(?P<behind>[µa-zA-Z]+)?", re.IGNORECASE)


_PERIOD = _stated(r"sampl[^\W_]*|tast\w*|cycle|abtast\w*|interval|resolution|\bdt|\bfs")
_TICK = _stated(r"ticks?")
_SAYS_RATE = re.compile(r"rate|freq|fs", re.IGNORECASE)
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}


@dataclass(frozen=True)
class TimeBase:
    """Where the stamps of a table come from."""

    time: Time  # as in a mapping
    reason: str
    doubt: str
    seconds: Array  # shape (n,): stamps [s]
    units: tuple[str, ...] = ("s",)  # units that the column may be in, the most probable first; one where it is certain

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the stamps: one, those of a formula, or none."""
        if self.time.compute is not None:
            return tuple(Expression(self.time.compute).columns)
        return () if self.time.column is None else (str(self.time.column),)

    @property
    def runs(self) -> list[slice]:
        """Rows of each run, between which the time starts again.

        Left out are runs of less than ten rows, and such in which it stands still: a buffer that was not filled to its
        end holds zeros there.
        """
        back = np.flatnonzero(np.diff(self.seconds) < 0) + 1
        edges = [0, *back.tolist(), self.seconds.size]
        pieces = [slice(a, b) for a, b in itertools.pairwise(edges)]
        longest = max(one.stop - one.start for one in pieces)
        enough = [one for one in pieces if one.stop - one.start >= min(_FEWEST_ROWS, longest)]
        return [one for one in enough if not self.stands_still(one)] or enough

    def stands_still(self, rows: slice) -> bool:
        """Whether all rows of a piece have the same stamp."""
        return bool(self.seconds[rows].min() == self.seconds[rows].max())


def find_time_base(
    table: Table, numbers: dict[str, Array], given: Given | None, count: int, period: float | None
) -> TimeBase:
    """Find the stamps of a table.

    `numbers` (n,): its columns of numbers.
    `given`: what the user says of the time column.
    `count`: rows.
    `period`: sampling period [s] that the user gives.
    Raises InputError: no column is a time, and nothing says the period.
    """
    if period is not None:
        if not (np.isfinite(period) and period > 0.0):
            raise InputError(
                f"a row every {period:g} s is none; give the rows per second with --rate HZ or the seconds per row with"
                " --period S, above zero and finite"
            )
        return _even(count, period, "as given", _disagreement(table, numbers, period))
    if given is not None and given.column:
        return _given(table, numbers, given)
    rows = max((len(column) for column in table.columns.values()), default=0)
    if rows < _FEWEST_STAMPS:
        raise InputError(
            f"{table.path}: only {rows} {'row' if rows == 1 else 'rows'} of data; check that the recording was saved"
            " whole"
        )
    unit = given.unit if given is not None else ""
    name = _named(table, numbers)
    if name and is_counter(name_in(table, name)) and not unit:
        found = _period_in_name(name) or _increment(table) or _period_in_notes(table)
        if found is None:
            raise InputError(
                f"{table.path}: {name!r} counts samples and is no time; say how often one was taken: --rate HZ or"
                " --period S"
            )
        doubt = f"{name!r} does not rise by one with each row, but the rows are taken as even"
        return _even(count, *found, "" if counts_rows(numbers[name]) else doubt)
    if name:
        return _of_column(table, numbers, name, unit, _role(table, name).reason)
    if (base := _between_rows(table, numbers, count)) is not None:
        return base
    for name in table.columns:
        if name not in numbers and (dates := dates_ns(table.raw(name))) is not None and np.ptp(dates) > 0.0:
            return _of_column(table, numbers, name, unit, "by its cells")
    if (tick := _period_in_notes(table, _TICK)) and (counter := _counter(table, numbers)):
        time = Time(compute=f"{quoted(counter)} * {tick[0]:.12g}", unit="s")
        return TimeBase(time, tick[1], "", tick[0] * numbers[counter])
    if found := _increment(table) or _period_in_notes(table):
        return _even(count, *found)
    if (base := _rising(table, numbers, unit)) is not None:
        return base
    raise InputError(
        f"{table.path}: no column is a time{_why_not(table, numbers)}; name it with --time COLUMN, or say how often a"
        f" row was taken: --rate HZ or --period S (columns are {listed(table.of_record, 20)})"
    )


def _even(count: int, period: float, reason: str, doubt: str = "") -> TimeBase:
    return TimeBase(Time(period=period), reason, doubt, np.arange(count, dtype=np.float64) * period)


def _rising(table: Table, numbers: dict[str, Array], unit: str) -> TimeBase | None:
    """Take a column for the time that rises from row to row, whose name says nothing; None without one."""
    # What a name says to be another signal is no time, however evenly it rises: a table of steady states has none.
    may_be = {
        name: value
        for name, value in numbers.items()
        if not is_counter(name_in(table, name)) and _may_be_clock(table, name)
    }
    steady = [name for name, value in may_be.items() if _is_clock(value)] or [
        name for name, value in may_be.items() if value.size > _FEWEST_ROWS and (np.diff(value) > 0).all()
    ]
    # Of two columns that rise evenly, the one that rises by one counts the rows.
    steady = [name for name in steady if not (_role(table, name).role or counts_rows(numbers[name]))] or steady
    again = [] if steady else [name for name, value in may_be.items() if _starts_again(value)]
    name = next(iter(steady or again), None)
    if name is None:
        return None
    base = _of_column(table, numbers, name, unit, f"it rises from row to row{', and starts again' if again else ''}")
    how, other = "from row to row", ", or --rate HZ"
    if counts_rows(numbers[name]):
        how, other = "by one with each row, and may count the rows", ", or if it counts --rate HZ"
    doubt = (
        f"no name says that {name!r} is the time: it rises {how}, and is taken as a time in {base.time.unit}: --time"
        f" COLUMN=UNIT{other}"
    )
    return replace(base, doubt=doubt)


def _between_rows(table: Table, numbers: dict[str, Array], count: int) -> TimeBase | None:
    """Take the rows as even by a column that holds the time since the row before; None without one."""
    for name, value in numbers.items():
        parsed = name_in(table, name)
        if role_by_name(parsed).role != "time" or not _is_interval(value, parsed.words):
            continue
        unit = parsed.unit if parsed.unit in SECONDS else _units_of_time(np.nancumsum(value))[0][0]
        least, mean, most = (SECONDS[unit] * float(of(value)) for of in (np.nanmin, np.nanmean, np.nanmax))
        doubt = f"rows are taken as even, {mean:.4g} s apart, but {name!r} says {least:.4g} to {most:.4g} s"
        reason = f"{name!r} is the time between rows, {mean:.4g} s on average"
        return _even(count, mean, reason, "" if most - least <= _SAME * mean else doubt)
    return None


def _is_interval(value: Array, words: Sequence[str]) -> bool:
    """Whether a column of a time says how long ago the row before was: it goes up and down around one value."""
    known = value[np.isfinite(value)]
    if known.size <= _FEWEST_ROWS or not (known > 0.0).all():
        return False
    if np.ptp(known) == 0.0:
        return not _INTERVAL_WORDS.isdisjoint(words)
    falls = float(np.mean(np.diff(known) < 0.0))
    return falls > _MOST_FALLS and float(np.std(known)) < _AROUND * float(np.mean(known))


def _counter(table: Table, numbers: dict[str, Array]) -> str:
    """Return the column that counts ticks: by its name, else the first that rises evenly; empty without."""
    even = [name for name in table.columns if name in numbers and _is_clock(numbers[name])]
    free = [name for name in even if _may_be_clock(table, name)]
    ticks = [name for name in even if _TICK_WORDS.intersection(name_in(table, name).words)]
    return next(iter((*ticks, *free)), "")


def _why_not(table: Table, numbers: dict[str, Array]) -> str:
    """Say what keeps columns that could be a time from being one; empty where none could."""
    said = [f"{name!r} {why}" for name in table.columns if (why := _why_no_time(table, numbers, name))]
    return f" ({'; '.join(said[:3])})" if said else ""


def _why_no_time(table: Table, numbers: dict[str, Array], name: str) -> str:
    parsed, value = name_in(table, name), numbers.get(name)
    role = role_by_name(parsed).role
    if is_counter(parsed):
        return "counts the rows"
    if role != "time":
        if value is not None and _is_clock(-value):
            return _BACKWARDS
        even = role and value is not None and _is_clock(value)
        return f"rises evenly, but is the {role} by its name: a table of steady states has no time" if even else ""
    if value is None:
        cell = next((str(cell) for cell in table.raw(name) if str(cell).strip()), "")
        return f"is {cell[:40]!r}, neither {_WAYS}" if cell else "is empty"
    known = value[np.isfinite(value)]
    if float(np.ptp(known)) == 0.0:
        return f"is {known[0]:g} in every row"
    return _BACKWARDS if (np.diff(known) <= 0.0).all() else "falls from row to row as often as it rises"


def base_of_clock(table: Table, name: str, said: str, given: str) -> TimeBase:
    """Return the stamps that the file gives to its signals, in the unit that the user or the file says, if any."""
    reason = "the file has stamps for every signal"
    if any(isinstance(cell, str) for cell in table.raw(name)[:1]):
        return _of_column(table, {}, name, "", reason)
    unit = _unit_given(table, "", given) or said
    return _of_values(Time(column=name), table.numbers(name), reason, unit, option="")


def _role(table: Table, name: str) -> RoleByName:
    return role_by_name(name_in(table, name))


def _may_be_clock(table: Table, name: str) -> bool:
    """Whether a name does not say that a column is another signal than the time."""
    words = name_in(table, name).words
    return _role(table, name).role in ("", "other") or (bool(words) and set(words) <= _OF_CLOCKS)


def _named(table: Table, numbers: dict[str, Array]) -> str:
    """Return the column that is a time by its name; empty where there is none."""
    ranked = []
    for position, name in enumerate(table.columns):
        if _role(table, name).role == "time" and _may_be_time(table, numbers, name):
            # A column that starts again now and then is as good; a fine one is better.
            levels = np.unique(numbers[name]).size if name in numbers else len(set(table.raw(name)))
            ranked.append((-_role(table, name).rank, -levels, position, name))
    return min(ranked)[-1] if ranked else ""


def _disagreement(table: Table, numbers: dict[str, Array], period: float) -> str:
    """Doubt about a given period where a column of stamps says another one; empty where none does."""
    name = _named(table, numbers)
    if not name:
        return ""
    base = _of_column(table, numbers, name, "", "")
    step = float(np.nanmedian(np.diff(base.seconds)))
    possible = [step * SECONDS[unit] / SECONDS[base.units[0]] for unit in base.units]
    # Stamps too coarse to say a period are what a rate is given for.
    if step <= 0.0 or any(abs(one / period - 1.0) < _SAME for one in possible):
        return ""
    return (
        f"a row every {period:g} s as given, but {name!r} says every {step:.4g} s: leave the rate out to read the time"
        " there"
    )


def _increment(table: Table) -> tuple[float, str] | None:
    """Sampling period [s] that the file holds once, or its rate, and why."""
    for name in [*table.columns, *table.attributes]:
        *within, plain = re.split(r"[./]", name.lower().strip())
        rate = _RATE.fullmatch(plain) is not None
        # Deep in a file it is that of something else.
        if len(within) > 1 or (plain not in _INCREMENTS and not rate):
            continue
        try:
            raw = [table.attributes[name]] if name in table.attributes else table.numbers(name)
            value = np.asarray(raw, dtype=np.float64)
        except (InputError, ValueError):
            continue
        once = value[np.isfinite(value)]
        if once.size == 1 and once[0] > 0.0:
            period = 1.0 / float(once[0]) if rate else float(once[0])
            return period, f"{name!r} says every {period:g} s"
    return None


def _may_be_time(table: Table, numbers: dict[str, Array], name: str) -> bool:
    if name not in numbers:
        dates = dates_ns(table.raw(name))
        return dates is not None and bool(np.ptp(dates) > 0.0)
    value = numbers[name][np.isfinite(numbers[name])]
    if _is_interval(value, name_in(table, name).words):
        return False
    return value.size > 2 and float(np.ptp(value)) > 0.0 and float(np.mean(np.diff(value) >= 0)) >= _RISING


def _is_clock(value: Array) -> bool:
    """Whether a column rises in nearly equal steps."""
    step = np.diff(value)
    return bool(
        value.size > _FEWEST_ROWS
        and np.isfinite(step).all()
        and np.median(step) > 0
        and np.mean(np.abs(step / np.median(step) - 1.0) < 0.5) > _EVEN
    )


def counts_rows(value: Array) -> bool:
    """Whether each row of a column is the one before and one."""
    return value.size > _FEWEST_ROWS and bool((np.diff(value) == 1.0).all())


def _starts_again(value: Array) -> bool:
    """Whether a column rises throughout but for falls back to where it began."""
    step = np.diff(value)
    if value.size <= _FEWEST_ROWS or not np.isfinite(step).all():
        return False
    low = float(value.min())
    begins = value[1:][step < 0]
    return bool(
        begins.size
        and np.mean(step > 0) > _EVEN
        and (np.array([value[0], *begins]) - low).max() < _NEAR * float(np.ptp(value))
    )


def _of_column(table: Table, numbers: dict[str, Array], name: str, unit: str, reason: str) -> TimeBase:
    if name not in numbers:
        dates = dates_ns(table.raw(name))
        if dates is None:
            raise InputError(f"{table.path}: time column {name!r} holds neither {_WAYS}; name another with --time")
        seconds = np.asarray(dates * 1e-9, dtype=np.float64)
        time = Time(column=name, unit="iso8601")
        return TimeBase(time, f"{reason}; dates in ISO 8601", _stands_still(name, seconds), seconds)
    given, said = _unit_given(table, name, unit), name_in(table, name).unit
    known = given or (said if said in SECONDS else "")
    return _of_values(Time(column=name), numbers[name], reason, known, "as given" if given else "by its name")


def _of_values(time: Time, value: Array, reason: str, unit: str, why: str = "", option: str | None = None) -> TimeBase:
    """Return stamps in a unit, or in the most probable one where it is empty.

    `why` it is in this unit; `option`: as the column stands in options, by default its name.
    """
    name = str(time.source)
    units, why = ((unit,), why) if unit else _units_of_time(value)
    certain = len(units) == 1
    doubt = _stands_still(name, value) if certain else doubt_of_unit(name if option is None else option, units[0])
    reason = f"{reason}; {units[0]} {why}" if why else reason
    time = time.model_copy(update={"unit": units[0]})
    return TimeBase(time, reason, doubt, value * SECONDS[units[0]], units)


def _unit_given(table: Table, option: str, unit: str) -> str:
    """Unit of time that the user gives; refused where it is none."""
    if unit and known_unit(unit) not in SECONDS:
        raise InputError(f"{table.path}: --time {option}={unit}: not a unit of time; known are {', '.join(SECONDS)}")
    return known_unit(unit)


def _given(table: Table, numbers: dict[str, Array], given: Given) -> TimeBase:
    """Return the stamps of the column, or of the formula over columns, that the user gives."""
    name = given.column
    if name in table.columns:
        if name in numbers:
            _check_given(table, name, numbers[name])
        return _of_column(table, numbers, name, given.unit, "as given")
    unit = _unit_given(table, name, given.unit)
    value = checked_formula(table, "time", given, numbers).evaluate(numbers)
    _check_given(table, name, value)
    return _of_values(Time(compute=name), value, "as given", unit, "as given")


def _check_given(table: Table, name: str, value: Array) -> None:
    """Refuse a given time that falls as often as a signal does, or stands still."""
    change = np.diff(value)
    rises, falls = int(np.count_nonzero(change > 0.0)), int(np.count_nonzero(change < 0.0))
    if falls > _MOST_FALLS * rises or rises < _FEWEST_RISES * change.size:
        raise InputError(
            f"{table.path}: {name!r} is no time: from row to row it rises {rises} times and falls {falls} times, of"
            f" {change.size}"
        )


def _stands_still(name: str, value: Array) -> str:
    """Doubt about stamps that are too coarse; empty where they are not."""
    if np.nanmedian(np.abs(np.diff(value))) > 0.0 or value.size < _FEWEST_ROWS:
        return ""
    return f"{name!r} is the same in most rows and the row before: say how often a row was taken, --rate HZ"


def doubt_of_unit(name: str, unit: str) -> str:
    """Doubt about a unit of time that nothing says; without a name of the column for all stamps."""
    return f"the unit of time is not written down and taken as {unit}: if it is not, --time '{name}=UNIT'"


def _units_of_time(value: Array) -> tuple[tuple[str, ...], str]:
    """Units in which stamps may be, the most probable first, and why."""
    known = value[np.isfinite(value)]
    for unit, factor in SECONDS.items():
        if _DATES[0] < float(known[0]) * factor < _DATES[1]:
            return (unit,), "because they are dates then"
    steps = np.abs(np.diff(known))
    # Of stamps that stand for several rows the step is that of a row.
    step = float(np.median(steps)) or float(np.mean(steps))
    whole = bool((known == np.round(known)).all())
    fitting = [unit for unit, factor in SECONDS.items() if _SHORTEST <= step * factor <= _LONGEST]
    # Whole numbers count milliseconds or microseconds; a clock in seconds has decimals.
    fitting = [unit for unit in fitting if whole or unit in ("s", "ms")]
    if not whole and _LONGEST < step <= _SLOWEST:
        # A slow log in seconds, or a fast one in milliseconds: of these few have more than 2 kHz.
        fitting = ["s", *fitting] if step < _FINE else [*fitting, "s"]
    elif whole:
        # A slow log in a coarser unit is as possible, and none of these is written down.
        fitting += [unit for unit, factor in SECONDS.items() if _LONGEST < step * factor <= _SLOWEST]
    if not fitting:
        return ("s",) if not whole else ("s", "ms"), "as usual"
    if not whole and step <= _LONGEST and fitting[0] == "s":
        return ("s",), f"because a sample every {step:.3g} s is usual"
    if len(fitting) == 1:
        return tuple(fitting), f"because a sample every {step:g} {fitting[0]} is usual"
    return tuple(fitting), f"because a sample every {step:g} {fitting[0]} is the most usual"


def doubt_of_decimation(table: Table, base: TimeBase) -> str:
    """Doubt about a log of which rows were left out, by the period that the notes above it state; empty without."""
    noted = _period_in_notes(table)
    step = float(np.median(np.diff(base.seconds))) if base.time.source is not None and base.seconds.size > 1 else 0.0
    if noted is None or step < _DECIMATED * noted[0]:
        return ""
    return (
        f"{noted[1]}, but the rows are {step:.4g} s apart: what was faster than {0.5 / step:.4g} Hz looks slower than"
        " it was, unless it was filtered before rows were left out"
    )


def _period_in_name(name: str) -> tuple[float, str] | None:
    """Sampling period that the name of a column states [s], and why."""
    match = _IN_NAME.search(name)
    if match is None or known_unit(match[2]) not in SECONDS:
        return None
    period = float(match[1].replace(",", ".")) * SECONDS[known_unit(match[2])]
    return (period, f"its name says every {period:g} s") if period > 0.0 else None


def _period_in_notes(table: Table, stated: re.Pattern[str] = _PERIOD) -> tuple[float, str] | None:
    """Period that the notes above a table state [s], of the rows or of what counts them, and why."""
    for line in [*table.text.comments, *table.text.preamble] if table.text else []:
        match = stated.search(line)
        if match is None:
            continue
        number = float((match["times"] or match["number"]).replace(",", "."))
        unit = match["of"] or match["before"] or match["behind"] or ""
        unit = "hz" if not known_unit(unit) and _SAYS_RATE.search(match[0]) and unit.lower() not in _HERTZ else unit
        reason = f"the notes above the table say {match[0].strip()!r}"
        if number and unit.lower() in _HERTZ:
            return 1.0 / (number * _HERTZ[unit.lower()]), reason
        if number and known_unit(unit) in SECONDS:
            return number * SECONDS[known_unit(unit)], reason
    return None
