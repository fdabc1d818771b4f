"""The files of a log and what their columns are."""

from __future__ import annotations

import itertools
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from idloop.called_as import program
from idloop.errors import InputError
from idloop.records.bags.storage.bag_paths import is_bag
from idloop.records.bags.storage.storage_files import bag_name
from idloop.records.recognition.bag_table import bag_table
from idloop.records.recognition.column_name import parse_column_name
from idloop.records.recognition.guess import MOTION, ROLES, Given, quoted
from idloop.records.recognition.recognise import recognise_table, shown_together
from idloop.records.recognition.role_units import base_field
from idloop.records.recognition.roles import is_named_as_signal, role_by_name
from idloop.records.recognition.table_column import numbers_of
from idloop.records.recognition.time_base import doubt_of_unit, find_time_base
from idloop.records.tables.base_units import SECONDS, base_unit, known_unit
from idloop.records.tables.mapping import Time
from idloop.records.tables.table import joined_tables
from idloop.records.tables.table_files import read_table
from idloop.reporting.text.blocks import Block, Table
from idloop.spelling import joined_names, listed

if TYPE_CHECKING:
    from idloop.records.recognition.guess import Guess
    from idloop.records.recognition.recognise import Recognition
    from idloop.records.recognition.time_base import TimeBase
    from idloop.records.tables.table import Table as Columns

_Read = TypeVar("_Read")
_TURNED = re.compile(r"-(\w+|`[^`]*`)")
_WORDS = re.compile(r"[_\-.0-9]+")
_SHORTEST_NAME = 2  # letters that several names must have in common to give one
_OVERLAP = 0.5  # share of the shorter file that two files of one run have at least in common
# What one file shows holds for the others: values that start again, and negative ones logged as unsigned.
_OF_ALL = ("wrap", "decode")
_FEW = 5  # columns that are not used, of which the names are said
_TEXT = "its cells are text"
_COUNTERS, _ON = (16, 24, 32), 5.0  # bits of counters, and intervals by which they go on from full to zero at most
# Files whose commands are compared at least; how far their motions may differ, and a command that is in another unit.
_FEWEST_COMPARED, _ALIKE, _OTHER_UNIT = 3, 10.0, 100.0
_FEW_SAMPLES = 100  # rows of a piece below which it is not worth a record


@dataclass(frozen=True)
class Log:
    """Files as they were recognised."""

    files: tuple[Path, ...]
    recognitions: tuple[Recognition, ...]  # of each file, or of all joined
    joined: bool = False  # whether the files are one record with a signal or more in each
    between: tuple[str, ...] = ()  # what is uncertain about the files beside each other
    late: float = 0.0  # time by which the command was recorded late [s]

    @property
    def recognition(self) -> Recognition:
        """What the first file holds; the others have the same columns."""
        return self.recognitions[0]

    @property
    def name(self) -> str:
        """Name of the file, or what the names of several have in common."""
        names = [_plain_name(path) for path in self.files]
        common = _common_name(names)
        if len(names) == 1 or len(common) < _SHORTEST_NAME:
            return "_".join(names) if len(names) < 3 else f"{names[0]}_and_{len(names) - 1}_more"
        return common

    @property
    def runs(self) -> dict[str, tuple[Path, dict[str, Any]]]:
        """Source of each record by its name, and what it is of the source, as a part of a mapping."""
        found = {}
        sources = (self.folder,) if self.joined else self.files
        for source, one in zip(sources, self.recognitions, strict=True):
            name = self.name if self.joined else _plain_name(source)
            for piece, window in one.runs.items():
                found[f"{name}_{_plain(piece)}" if piece else name] = source, window
        if len(found) < sum(len(one.runs) for one in self.recognitions):
            raise InputError("two files have the same name; rename one, so that their bags can have theirs")
        return found

    @property
    def folder(self) -> Path:
        """Folder of the first file; files that are joined lie in one."""
        return self.files[0].parent

    @property
    def notes(self) -> list[str]:
        """How the files are written, and which records they hold; what is alike is said once."""
        found: dict[str, list[str]] = {}
        for one in self.recognitions:
            for note in (*one.table.notes, *_records_in(one)):
                found.setdefault(note, []).append(one.table.path.name)
        # Of joined files each note names its own.
        return [note if self.joined else f"{listed(names, 3)}: {note}" for note, names in found.items()]

    @property
    def empty(self) -> list[str]:
        """Columns without a value in the first file."""
        return [name for name in self.recognition.other if _is_empty(self.recognition.table, name)]

    @property
    def unused(self) -> list[str]:
        """Lines with the columns that are no signal, and why where it shows; those named as a signal of text first."""
        table, empty = self.recognition.table, self.empty
        why = {name: _why_unused(table, name) for name in self.recognition.other if name not in empty}
        named = [name for name in why if why[name] == _TEXT and is_named_as_signal(name)]
        unused = [f"{name} ({why[name]})" if why[name] else name for name in dict.fromkeys([*named, *why])]
        lines = {"not used": unused, "empty": empty}
        return [f"{title}: {listed(names, _FEW)}" for title, names in lines.items() if names]

    @property
    def doubts(self) -> list[str]:
        """Everything uncertain."""
        return [*self.recognition.all_doubts(), *self.between]

    @property
    def turned_column(self) -> str:
        """The command with its sign turned, as a formula or number; empty where a formula cannot say it."""
        one = self.recognition.of("command")
        if one is None or self.recognition.sources or set(one.options) - {"compute", "value"}:
            return ""
        if "value" in one.options:
            return f"{-one.options['value']:g}"
        if "compute" in one.options:
            turned = _TURNED.fullmatch(one.column)
            return turned[1].strip("`") if turned else f"-({one.column})"
        return f"-{one.column}" if one.column.isidentifier() else f"-`{one.column}`"

    @property
    def turned_command(self) -> str:
        """The option that turns the sign of the command; empty where there is none."""
        return self._command(self.turned_column) if self.turned_column else ""

    @property
    def signed_command(self) -> str:
        """The option that gives the command the sign of a column; empty where there is none."""
        return self._command_with_sign_of("COLUMN")

    @property
    def command_with_sign_of_error(self) -> str:
        """The option that gives the command the sign of the control error; empty where no set-point was recorded."""
        for wanted, measured in (("reference", "position"), ("reference velocity", "velocity")):
            one, other = self.recognition.of(wanted), self.recognition.of(measured)
            if one is None or other is None or (one.unit, one.options) != (other.unit, other.options):
                continue
            if not one.options.keys() & {"wrap", "decode", "compute"}:
                return self._command_with_sign_of(f"{quoted(one.column)} - {quoted(other.column)}")
        return ""

    def _command_with_sign_of(self, formula: str) -> str:
        return self._command(f"{self.turned_column.removeprefix('-')} * sign({formula})") if self.turned_column else ""

    @property
    def exchanged_command(self) -> str:
        """The options that exchange command and velocity; empty where one of them is no plain column of a table."""
        command, velocity = self.recognition.of("command"), self.recognition.of("velocity")
        if command is None or velocity is None or self.recognition.sources or command.options or velocity.options:
            return ""
        pair = {"command": (velocity.column, command.unit), "velocity": (command.column, velocity.unit)}
        return " ".join(f"--{role} '{column}{f'={unit}' if unit else ''}'" for role, (column, unit) in pair.items())

    def rows_without(self, places: Sequence[tuple[float, float]]) -> str:
        """The options that leave out times of the record, from .. to [s from its first stamp], and cut it there.

        Empty where the files or their records are several, or no piece is long enough to be of use.
        """
        if len(self.files) > 1 or len(self.runs) > 1 or not places:
            return ""
        seconds, begin = self.recognition.base.seconds, self.recognition.begin
        first = self.recognition.rows[0].start if self.recognition.rows else 0
        begins, ends = np.searchsorted(seconds, begin + np.array(sorted(places)).T + [[1e-9], [-1e-9]])
        pieces = zip([first, *ends], [*begins, seconds.size], strict=True)
        long = [f"--rows {start}:{stop}" for start, stop in pieces if stop - start >= _FEW_SAMPLES]
        return " ".join(long)

    def command_in(self, unit: str) -> str:
        """The option that gives the command a unit."""
        one = self.recognition.of("command")
        return f"--command '{one.column if one is not None and one.column else self.turned_column}={unit}'"

    def _command(self, formula: str) -> str:
        one = self.recognition.of("command")
        return f"--command '{formula}{f'={one.unit}' if one is not None and one.unit else ''}'"

    def blocks(self) -> Iterator[Block]:
        """Yield a table of what each column is taken for, and what is uncertain."""
        found = self.recognition
        yield from self.notes
        rows = [("time", str(found.base.time.source or "-"), _time_unit(found), found.base.reason)]
        rows += [(one.role, one.column or _constant(one.options), one.unit or "?", one.reason) for one in found.guesses]
        yield Table.of(("signal", "column", "unit", "why"), rows)
        yield from self.unused
        for doubt in self.doubts:
            yield f"check: {doubt}"


def recognise(
    files: str | Path | Iterable[str | Path],
    given: Mapping[str, str] | None = None,
    *,
    period: float | None = None,
    csv: Mapping[str, Any] | None = None,
    rows: Sequence[slice] = (),
    late: float = 0.0,
) -> Log:
    """Find out what the columns of a log are, without writing anything.

    `files`, `given`, `period`, `csv`, `rows`, `late`: as in `idloop.start`.
    Raises InputError: a file cannot be read, or has no time, no command or no motion.
    """
    if hasattr(files, "columns"):
        raise InputError(
            "a data frame is no file: write it to one by frame.to_csv('log.csv', index=False), or make a record of it"
            " by idloop.Record.from_frame"
        )
    paths = tuple(Path(one) for one in ([files] if isinstance(files, str | Path) else files))
    if not paths:
        raise InputError("name at least one file")
    if bags := [path for path in paths if is_bag(path)]:
        if len(bags) < len(paths):
            raise InputError(
                f"{bags[0]}: a bag or folder beside tables: start bags alone, and give a folder to write to by --output"
            )
        return replace(_of_bags(paths, given or {}, rows), late=late)
    options = {"skip_text": True, **(csv or {})}
    tables = _each([partial(read_table, path, options=options) for path in paths], paths)
    said = _given(given or {}, [name for table in tables for name in table.columns])
    if runs := _runs_of_files(tables):
        each = " and ".join(f"`{program()} start {shlex.join(map(str, run))}`" for run in runs[:2])
        raise InputError(
            f"the names of the files are those of {len(runs)} records with {len(runs[0])} files each: start each record"
            f" alone, as in {each}, and give the bags of all of them to fit, diagnose and refine"
        )
    if any(set(one.columns) != set(tables[0].columns) for one in tables) or _are_signals(tables):
        if rows:
            raise InputError("--rows cuts one file, or files with the same columns")
        return replace(_joined(paths, tables, said, period), late=late)
    for table in tables if rows else ():
        if not table.clocks:
            table.begins = tuple(sorted({*table.begins, *_edges(rows, max(map(len, table.columns.values())))}))
    shown = shown_together(tables, said, period=period) if len(tables) > 1 and not tables[0].clocks else None
    found = _alike(
        _each([partial(recognise_table, table, said, period=period, shown=shown) for table in tables], paths)
    )
    between = (*_read_otherwise(found), *_of_another_size(found))
    return Log(paths, tuple(_cut_apart(one, rows) for one in found), between=between, late=late)


def _cut(rows: Sequence[slice], count: int) -> tuple[slice, ...]:
    """The rows that the user wants, within those that there are."""
    return tuple(slice(*one.indices(count)[:2]) for one in rows)


def _cut_apart(found: Recognition, rows: Sequence[slice]) -> Recognition:
    """Take the rows that the user wants of the motion, each piece a record; all where none are said."""
    if not rows:
        return found
    count = found.base.seconds.size
    _edges(rows, count)
    return replace(found, rows=_cut(rows, count), table=replace(found.table, parts={}))


def _edges(rows: Sequence[slice], count: int) -> tuple[int, ...]:
    """Rows at which a record, or what lies between two, begins. Raises InputError: a piece is empty."""
    pieces = _cut(rows, count)
    for one, said in zip(pieces, rows, strict=True):
        if one.stop <= one.start:
            raise InputError(f"--rows {said.start or 0}:{said.stop or ''} holds nothing: the table has {count} rows")
    return (0, *(edge for one in pieces for edge in (one.start, one.stop) if edge < count))


def check_signals(given: Iterable[str]) -> None:
    """Refuse names that are no signals. Raises InputError: one is none."""
    unknown = next((role for role in given if role not in ("time", *ROLES)), None)
    if unknown is not None:
        raise InputError(f"no signal {unknown!r}; known are time, {', '.join(ROLES)}")


def _given(given: Mapping[str, str], columns: list[str]) -> dict[str, Given]:
    check_signals(given)
    said = {role: Given.parse(text, columns) for role, text in given.items()}
    named: dict[str, str] = {}
    for role, one in said.items():
        if one.column in columns and (other := named.setdefault(one.column, role)) != role:
            raise InputError(f"the {other} and the {role} are both to be {one.column!r}; give each a column of its own")
        _check_unit(role, one.unit)
    return said


def _check_unit(role: str, unit: str) -> None:
    """Refuse the unit of another quantity; what is no known unit is read elsewhere, such as counts per turn."""
    if role != "time" and known_unit(unit) not in ("", "counts", *SECONDS):
        base_unit(known_unit(unit), base_field(role), f"{role}={unit}")


# ---------------------------------------------------------------- several files


def _each(readers: Sequence[Callable[[], _Read]], paths: Sequence[Path]) -> list[_Read]:
    """Read or recognise every file; a refusal of some of them says how to go on with the others."""
    found, errors = [], {}
    for path, reader in zip(paths, readers, strict=True):
        try:
            found.append(reader())
        except InputError as error:
            errors[path] = error
    if not errors:
        return found
    if not found:
        raise next(iter(errors.values()))
    sound = [str(path) for path in paths if path not in errors]
    raise InputError(
        f"{next(iter(errors.values()))}; or leave {joined_names([path.name for path in errors])} out, with the options"
        f" as they are: {program()} start {shlex.join(sound)}"
    )


def _alike(found: list[Recognition]) -> list[Recognition]:
    """Read every file as the others show it: an encoder that starts again in one of them may do so in all."""
    for role in {one.role for some in found for one in some.guesses}:
        guesses = [one for some in found if (one := some.of(role)) is not None]
        shown = {key: (one.options[key], one) for one in guesses for key in _OF_ALL if key in one.options}
        for key, (value, source) in shown.items():
            found = [_with_option(some, source, key, value) for some in found]
    return found


def _with_option(found: Recognition, source: Guess, key: str, value: object) -> Recognition:
    def changed(one: Guess) -> Guess:
        if (one.role, one.column, one.unit) != (source.role, source.column, source.unit) or key in one.options:
            return one
        return replace(source, options={**one.options, key: value})

    return replace(found, guesses=tuple(map(changed, found.guesses)))


def _read_otherwise(found: list[Recognition]) -> Iterator[str]:
    """Yield a doubt for each file that would be read otherwise than the first one, by which all are read."""
    first = found[0]
    roles = list(dict.fromkeys(one.role for some in found for one in some.guesses))
    for one in found[1:]:
        differing = [role for role in roles if _what(one.of(role)) != _what(first.of(role))]
        differing += ["time"] if one.base.time != first.base.time else []
        if differing:
            own = "; ".join(f"{role}: {_described(one, role)}" for role in differing)
            yield (
                f"{one.table.path.name} is read as {first.table.path.name}; alone it would have other signals ({own})"
            )


def _of_another_size(found: list[Recognition]) -> Iterator[str]:
    """Yield a doubt for files whose command is far larger or smaller than that of most, although the motion is not."""
    sizes = {one.table.path.name: (_spread(one, "command"), _spread(one, *MOTION)) for one in found}
    sizes = {name: size for name, size in sizes.items() if min(size) > 0.0}
    if len(sizes) < _FEWEST_COMPARED:
        return
    command, motion = np.median(list(sizes.values()), axis=0)
    times = {
        name: own / command for name, (own, moved) in sizes.items() if max(moved / motion, motion / moved) < _ALIKE
    }
    for said, names in {
        "larger": [name for name, one in times.items() if one > _OTHER_UNIT],
        "smaller": [name for name, one in times.items() if one < 1.0 / _OTHER_UNIT],
    }.items():
        if names:
            factor = float(np.median([max(times[name], 1.0 / times[name]) for name in names]))
            yield (
                f"command: in {listed(names, 3)} it is about {factor:.0f} times {said} than in the others, which move"
                " as far: another unit, such as A beside mA, or another signal; start these files apart"
            )


def _spread(found: Recognition, *roles: str) -> float:
    """Standard deviation of the signal of the first of some roles that a file has; 0 where none is a column."""
    guess = next((one for role in roles if (one := found.of(role)) is not None), None)
    if guess is None or guess.column not in found.table.columns:
        return 0.0
    value = found.table.numbers(guess.column)
    known = value[np.isfinite(value)]
    return float(np.std(known)) if known.size else 0.0


def _what(guess: Guess | None) -> object:
    return guess and (guess.column, guess.unit, guess.options)


def _described(found: Recognition, role: str) -> str:
    if role == "time":
        return f"{found.base.time.source or '-'} in {_time_unit(found)}"
    guess = found.of(role)
    return "none" if guess is None else f"{guess.column or _constant(guess.options)} in {guess.unit or '?'}"


def _joined(paths: tuple[Path, ...], tables: list[Columns], said: dict[str, Given], period: float | None) -> Log:
    """Recognise several files as one record."""
    if len({path.parent.resolve() for path in paths}) > 1:
        raise InputError(
            "the files have different columns and lie in different folders; put what belongs together into one"
        )
    between = _complete(tables)
    bases = {}
    # A unit holds for the stamps of every file; a column of the joined ones is none of a file.
    clock = said["time"] if "time" in said and not said["time"].column else None
    for table in tables:
        numbers = numbers_of(table)
        count = max((value.size for value in numbers.values()), default=0)
        bases[table.path.name] = base = find_time_base(table, numbers, clock, count, period)
        if base.time.column is not None and not table.clocks:
            stamps = str(base.time.column)
            table.units[stamps] = base.time.unit
            table.clocks = {name: stamps for name in table.columns if name != stamps}
    # Rows of files without stamps were taken together.
    common = period if all(base.time.column is None for base in bases.values()) else None
    found = recognise_table(joined_tables(paths[0].parent, tables), said, period=common)
    unsure = next((base for base in bases.values() if len(base.units) > 1), None)
    doubts = [] if unsure is None else [doubt_of_unit("", unsure.units[0])]
    return Log(paths, (found,), joined=True, between=(*between, *doubts, *_apart(bases)))


def _runs_of_files(tables: list[Columns]) -> list[list[Path]]:
    """Return the files of each record where there are several, each of several files; none where all are of one.

    The files of one signal have the same columns and a word in common, as in ``up_torque`` and ``down_torque``; the
    words that are left tell the records apart.
    """
    kinds: dict[tuple[str, ...], list[Path]] = {}
    for table in tables:
        # Of a value that only the file names, the name says which signal it is.
        named = "" if _names_signals(table) else role_by_name(parse_column_name(table.path.stem)).role
        kinds.setdefault((named, *sorted(table.columns)), []).append(table.path)
    if len(kinds) < 2 or len({len(paths) for paths in kinds.values()}) > 1 or len(kinds) == len(tables):
        return []
    runs: dict[tuple[str, ...], list[Path]] = {}
    for paths in kinds.values():
        words = [parse_column_name(path.stem) for path in paths]
        common = set.intersection(*(set(one.words) for one in words))
        for path, one in zip(paths, words, strict=True):
            rest = tuple(word for word in one.words if word not in common)
            runs.setdefault((*rest, one.index), []).append(path)
    whole = len(runs) == len(tables) / len(kinds) and all(len(run) == len(kinds) for run in runs.values())
    return list(runs.values()) if whole else []


def _are_signals(tables: list[Columns]) -> bool:
    """Whether files with the same columns are the signals of one record: a value that only the file names, and a time.

    The names of the files must be those of a command and a motion, as in ``torque.t`` and ``position.t``, and differ by
    more than a number. Without a time the files are as long as each other.
    """
    counts = {len(table.columns) for table in tables}
    if len(tables) < 2 or counts not in ({1}, {2}):
        return False
    if counts == {1} and len({len(column) for table in tables for column in table.columns.values()}) > 1:
        return False
    names = [parse_column_name(table.path.stem) for table in tables]
    roles = {role_by_name(name).role for name in names}
    named = {"command", "effort"} & roles and roles & set(MOTION) and len({name.words for name in names}) == len(names)
    return bool(named) and not _names_signals(tables[0])


def _names_signals(table: Columns) -> bool:
    """Whether a column is called a command or a motion."""
    roles = {role_by_name(parse_column_name(name)).role for name in table.columns}
    return bool(roles & {"command", "effort", *MOTION})


def _complete(tables: list[Columns]) -> list[str]:
    """Return a doubt where two files or more have a command and a motion by their names: each may be a record."""
    whole = [table.path.name for table in tables if _is_record(table)]
    if len(whole) < 2:
        return []
    text = (
        f"{joined_names(whole)} have a command and a motion each, but different columns, and are joined into one"
        " record: if they are records of their own, start each alone, or give them the same columns"
    )
    return [text]


def _is_record(table: Columns) -> bool:
    roles = {role_by_name(parse_column_name(name, table.units.get(name, ""))).role for name in table.columns}
    return bool(roles & {"command", "effort"} and roles & set(MOTION))


def _apart(bases: Mapping[str, TimeBase]) -> Iterator[str]:
    """Yield a doubt for two files whose times have little in common."""
    spans = {name: (float(base.seconds.min()), float(base.seconds.max())) for name, base in bases.items()}
    for (name, (begin, end)), (other, (start, stop)) in itertools.combinations(spans.items(), 2):
        if min(end, stop) - max(begin, start) < _OVERLAP * min(end - begin, stop - start):
            yield (
                f"the times of {name} ({begin:g} .. {end:g} s) and {other} ({start:g} .. {stop:g} s) have little or"
                " nothing in common: joined files are of one run, with one clock"
            )


def _of_bags(paths: tuple[Path, ...], given: Mapping[str, str], rows: Sequence[slice]) -> Log:
    """Recognise the topics of bags, each a record, or cut into several."""
    found = _each([partial(_of_bag, path, given) for path in paths], paths)
    return Log(paths, tuple(_cut_apart(one, rows) for one in found), between=tuple(_read_otherwise(found)))


def _of_bag(path: Path, given: Mapping[str, str]) -> Recognition:
    read = bag_table(path)
    said = _given(given, list(read.table.columns))
    one = recognise_table(read.table, said, sources=read.sources, joints=read.joints)
    one = replace(one, definitions=read.definitions)
    return _by_receipt(one) if read.received else one


def _by_receipt(found: Recognition) -> Recognition:
    """Take the times of receipt as stamps, and say so."""
    reason = "the stamps of the topics have no clock in common: the times of receipt are taken"
    doubt = f"{reason}; set `use_sim_time` alike for all nodes before the next recording"
    return replace(found, base=replace(found.base, time=Time(stamps="receive"), reason=reason, doubt=doubt))


# ---------------------------------------------------------------- words


def _records_in(found: Recognition) -> Iterator[str]:
    """Yield how many records a file holds and why, and how many rows belong to none."""
    if found.table.parts:
        names = list(found.table.parts)
        yield f"the file marks {len(names)} records, which become a bag each: {listed(names, 6)}"
        return
    # Where the columns have clocks of their own, only the user cuts.
    is_cut = bool(found.table.begins or found.table.clocks)
    if len(found.rows) > 1:
        starts = [str(one.start) for one in found.rows[1:]]
        why = "a record begins" if is_cut else _why_again(found)
        yield f"{why} in row {listed(starts, 6)}: {len(found.rows)} records, which become a bag each"
    if not found.rows or is_cut:
        return
    edges = [0, *(edge for one in found.rows for edge in (one.start, one.stop)), found.base.seconds.size]
    pieces = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
    still = [one for one in pieces if found.base.stands_still(one)]
    for one in still:
        stamp = found.base.seconds[one.start]
        yield f"{_rows(one.stop - one.start)} left out from row {one.start} on: the time is {stamp:g} s in all of them"
    if lost := sum(one.stop - one.start for one in pieces if one not in still):
        yield f"{_rows(lost)} left out: the time starts again there, and what follows is too short for a record"


def _why_again(found: Recognition) -> str:
    """Whether the time starts again, or its counter is full: then what was counted on fits to it."""
    count = found.base.seconds / SECONDS.get(found.base.time.unit, 1.0)
    usual = float(np.median(np.diff(count)))
    falls = [float(count[one.start] - count[one.start - 1]) for one in found.rows[1:] if one.start]
    full = next((bits for bits in _COUNTERS if falls and all(abs(fall + 2.0**bits) < _ON * usual for fall in falls)), 0)
    return f"the counter of the time is full at {2**full} and goes on" if full else "the time starts again"


def _rows(count: int) -> str:
    return "1 row is" if count == 1 else f"{count} rows are"


def _is_empty(table: Columns, name: str) -> bool:
    try:
        values = table.numbers(name)
    except InputError:
        return False
    return bool(np.isnan(values).all())


def _why_unused(table: Columns, name: str) -> str:
    """Why a column can be no signal, by its cells; empty where they do not say it."""
    try:
        values = table.numbers(name)
    except InputError:
        return _TEXT
    known = values[np.isfinite(values)]
    return "never changes" if known.size and float(np.ptp(known)) == 0.0 else ""


def _common_name(names: Sequence[str]) -> str:
    """What several names begin with, without a number, and without a word that goes on otherwise in each of them."""
    common = os.path.commonprefix(names)  # noqa: RUF071  (letters are meant)
    follow = [name[len(common) :] for name in names]
    within = common[-1:].isalpha() and all(one[:1].islower() for one in follow)
    words = _WORDS.split(common)
    if within and len(words) > 1:
        common = common[: len(common) - len(words[-1])]
    return common.rstrip("0123456789_-.")


def _plain_name(path: Path) -> str:
    """Name of a file without its suffix, of characters that every file system and ROS takes."""
    return _plain(bag_name(path) if is_bag(path) else path.stem or path.name) or "log"


def _plain(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in text).strip(".")


def _time_unit(found: Recognition) -> str:
    time = found.base.time
    return f"every {time.period:g} s" if time.period is not None else time.unit


def _constant(options: Mapping[str, Any]) -> str:
    return f"{options['value']:g}" if "value" in options else "name of the file"
