"""JSON files: samples, columns or runs by name, one object in each line, and the rows of WPILib's SysId."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_JSON_TABLE, read_json, read_text
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.tree import runs_in, table_of_runs, table_of_tree
from idloop.records.tables.table import Table
from idloop.spelling import check_known

# The names of the program, and those that its reports and later versions use.
_TESTS = (
    "slow-forward", "slow-backward", "fast-forward", "fast-backward", "track-width",
    "quasistatic-forward", "quasistatic-backward", "dynamic-forward", "dynamic-backward",
)  # fmt: skip
_MECHANISM = ("time", "voltage", "position", "velocity")
_DRIVETRAIN = (
    "time", "left voltage", "right voltage", "left position", "right position", "left velocity", "right velocity",
    "angle", "angular rate",
)  # fmt: skip
_KEYS = re.compile(r'\s*\{.*?"(?:fast|slow|dynamic|quasistatic)-(?:forward|backward)"\s*:', re.DOTALL)
_PAUSE = 1.0  # between tests that all count from their own beginning [s]
# Entries of a list within a sample that become columns of their own.
_MOST_ENTRIES = 64
# A list of at most as many mappings holds records or settings, not samples.
_HANDFUL = 9
# A number in brackets alone begins a line of a console log, and a list in each line is a table of text.
_JSON = re.compile(r'\s*(\{\s*["}]|\[\s*([\[\]{"]|-?\d[\d.eE+-]*\s*(,|\]\s*\Z)))')
_LISTS = re.compile(r"\s*\[[^\[\]{}]*\][ \t]*\r?\n\s*\[")


def read_sysid_json(path: Path, _: Options) -> Table:
    """Read the tests of a file one after the other; each is a part.

    Source: ``sysid-generate`` of WPILib 2021 to 2023 and the logger of its robot programs. Each row of a test has the
    numbers of `_MECHANISM`, or those of `_DRIVETRAIN`.
    """
    content = read_json(read_text(path, MOST_JSON_TABLE), str(path), MOST_JSON_TABLE)
    tests = {
        name: _rows(path, name, content[name]) for name in _TESTS if isinstance(content, dict) and content.get(name)
    }
    widths = {rows.shape[1] for rows in tests.values()}
    names = next((names for names in (_MECHANISM, _DRIVETRAIN) if widths == {len(names)}), None)
    if names is None:
        text = "no tests" if not tests else f"rows of {' and '.join(map(str, sorted(widths)))} numbers"
        raise InputError(
            f"{path}: {text}; SysId writes {len(_MECHANISM)} for a mechanism, {len(_DRIVETRAIN)} for a drivetrain"
        )
    order = sorted(tests, key=lambda name: float(tests[name][0, 0]))
    notes = []
    if any(tests[a][-1, 0] >= tests[b][0, 0] for a, b in pairwise(order)):
        notes.append(f"the tests overlap in time and are put one after the other, {_PAUSE:g} s apart")
        begin = 0.0
        for name in order:
            tests[name][:, 0] += begin - tests[name][0, 0]
            begin = tests[name][-1, 0] + _PAUSE
    whole = np.concatenate([tests[name] for name in order])
    table = Table(path, {name: whole[:, place] for place, name in enumerate(names)}, notes=notes)
    table.parts = {name: (float(tests[name][0, 0]), float(np.nextafter(tests[name][-1, 0], np.inf))) for name in order}
    table.clocks = dict.fromkeys(names[1:], names[0])
    table.units = {names[0]: "s"} | {name: "V" for name in names if name.endswith("voltage")}
    unit = content.get("units")
    if isinstance(unit, str):
        table.units |= {name: unit for name in names if name.endswith("position")}
        table.units |= {name: f"{unit}/s" for name in names if name.endswith("velocity")}
    table.attributes = {name: value for name, value in content.items() if isinstance(value, int | float | str)}
    return table


def _rows(path: Path, name: str, rows: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        found = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        found = np.empty(0)
    if found.ndim != 2 or not np.isfinite(found).all():
        raise InputError(f"{path}: {name} is no list of rows of as many finite numbers; check the copy of the file")
    return found


def read_json_table(path: Path, options: Options) -> Table:
    """Read a list of samples, or lists by name; the option ``entries`` is the key that holds them."""
    return table_of_content(path, read_json(read_text(path, MOST_JSON_TABLE), str(path), MOST_JSON_TABLE), options)


def read_json_lines(path: Path, _: Options) -> Table:
    """Read one sample from each line; a last line that is cut off is left out."""
    lines = read_text(path, MOST_JSON_TABLE).split("\n")
    last = max((k for k, line in enumerate(lines) if line.strip()), default=-1)
    samples: list[dict[str, Any]] = []
    notes: list[str] = []
    for number, line in enumerate(lines[: last + 1]):
        if not line.strip():
            continue
        try:
            sample = read_json(line, f"{path}: line {number + 1}", MOST_JSON_TABLE)
        except InputError:
            if number < last or not samples:
                raise
            notes.append("the last line is cut off and left out")
            break
        if not isinstance(sample, dict):
            raise InputError(f"{path}: line {number + 1} is no JSON object with the values of a sample by name")
        samples.append(sample)
    table = table_of_samples(path, samples)
    table.notes += notes
    return table


def table_of_content(path: Path, content: Any, options: Options) -> Table:
    """Return the table of a list of samples, or of columns by name.

    `options`: ``entries``: key of the mapping that holds them.
    """
    whole, key = content if isinstance(content, dict) else {}, options.get("entries")
    attributes = {name: value for name, value in whole.items() if isinstance(value, int | float | str)}
    if key is not None:
        check_known(key, whole, f"{path}: the samples have no key")
    if found := runs_in(content, key):
        return table_of_runs(path, *found)
    lists = [name for name, value in whole.items() if _holds_samples(value)] if key is None else [key]
    entries = whole[max(lists, key=lambda name: len(whole[name]))] if lists else content
    if isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries):
        return table_of_samples(path, entries, attributes)
    if isinstance(entries, dict):
        table = table_of_tree(path, entries)
        table.attributes = attributes | table.attributes
        return table
    if hasattr(entries, "ndim"):
        return table_of_tree(path, {"": entries})
    raise InputError(
        f"{path}: neither a list of samples nor columns; name the key that holds them as `entries:` in the mapping"
    )


def _holds_samples(value: Any) -> bool:
    """Whether a value is a list of samples: more than a handful of mappings, the first of numbers and texts."""
    return (
        isinstance(value, list)
        and len(value) > _HANDFUL
        and all(isinstance(one, dict) for one in value)
        and all(isinstance(one, int | float | str | None) for one in value[0].values())
    )


def table_of_samples(
    path: Path, samples: Sequence[Mapping[str, Any]], attributes: dict[str, float | str] | None = None
) -> Table:
    """Return a column for each value that a sample has, those within it as ``a.b`` and ``a[0]``."""
    columns: dict[str, list[Any]] = {}
    for number, sample in enumerate(samples):
        for name, value in _values(sample, ""):
            column = columns.get(name)
            if column is None:
                if len(columns) >= MOST_COLUMNS:
                    raise InputError(
                        f"{path}: more than {MOST_COLUMNS:,} values in a sample; check that this is the data file"
                    )
                column = columns[name] = []
            column.extend([None] * (number - len(column)))
            if len(column) == number:
                column.append(value)
        if number % 1000 == 0 and number * len(columns) > MOST_JSON_TABLE:
            raise InputError(f"{path}: its columns take too much memory; cut the file")
    for column in columns.values():
        column.extend([None] * (len(samples) - len(column)))
    return Table(path, columns, attributes or {})


def _values(sample: Mapping[str, Any], prefix: str) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in sample.items():
        full = f"{prefix}{name}"
        if isinstance(value, Mapping):
            found += _values(value, f"{full}.")
        elif isinstance(value, list | tuple):
            if 0 < len(value) <= _MOST_ENTRIES:
                found += _values({f"{name}[{place}]": one for place, one in enumerate(value)}, prefix)
        else:
            found.append((full, value))
    return found


def _is_json_lines(head: bytes) -> bool:
    lines = [line.strip() for line in text_of(head).split("\n") if line.strip()][:2]
    if len(lines) < 2 or not lines[1].startswith("{"):
        return False
    try:
        return isinstance(json.loads(lines[0]), dict)
    except (ValueError, RecursionError):
        return False


LINES = Form(
    "jsonl",
    (".jsonl", ".ndjson"),
    "JSON, one object in each line",
    "values of the samples by name; those of an object or a list within a sample are `a.b` and `a[0]`",
    _is_json_lines,
    read_json_lines,
)
FORM = Form(
    "json",
    (".json",),
    "JSON",
    "a list of samples `[{t: 0, u: 1}, ...]`, lists by name, or a list of runs with the same ones; `entries` names the"
    " key that holds them",
    lambda head: _JSON.match(text_of(head)) is not None and not _LISTS.match(text_of(head)),
    read_json_table,
)
SYSID = Form(
    "sysid",
    (),
    "JSON of WPILib's SysId",
    "`time`, `voltage`, `position`, `velocity` of a mechanism, with `left` and `right` of a drivetrain; each test"
    " is a part",
    lambda head: _KEYS.match(text_of(head)) is not None,
    read_sysid_json,
)
