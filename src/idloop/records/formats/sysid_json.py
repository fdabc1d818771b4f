"""JSON files of WPILib's SysId: rows of numbers for each test.

Source: WPILib, SysId of 2021 to 2023: ``sysid-generate`` and the logger of its robot programs. A row of a mechanism is
time, voltage, position, velocity; one of a drivetrain has the left and the right side, then angle and angular rate.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_JSON_TABLE, read_json, read_text
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.tables.table import Table

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


def read_sysid_json(path: Path, _: Options) -> Table:
    """Read the tests of a file one after the other; each is a part."""
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


FORM = Form(
    "sysid",
    (),
    "JSON of WPILib's SysId",
    "`time`, `voltage`, `position`, `velocity` of a mechanism, with `left` and `right` of a drivetrain; each test"
    " is a part",
    lambda head: _KEYS.match(text_of(head)) is not None,
    read_sysid_json,
)
