"""Traces that CODESYS saves as text: a head, then one block of stamps and values for each variable."""

from __future__ import annotations

import re
from array import array
from pathlib import Path

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.tables.table import Table

_VARIABLE = re.compile(r"(\d+)\.Variable\s*;\s*(.*?)\s*")
_HEAD = re.compile(r"\[key\]\s*;\s*\[value\]", re.IGNORECASE)
_WORDS = {"TRUE": 1.0, "FALSE": 0.0}
_LONGEST_LINE = 1 << 16


def read_codesys(path: Path, _: Options) -> Table:
    """Read the variables of a trace, each with its own stamps.

    Raises InputError: a row is damaged, or the file is too large.
    """
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; trace fewer variables")
    table = Table(path, {})
    stamps: array[float] = array("d")
    values: array[float] = array("d")
    name = ""

    def finish() -> None:
        if name and stamps:
            clock = f"{name}.time"
            table.columns |= {name: np.array(values), clock: np.array(stamps)}
            table.clocks[name] = clock
            table.units[clock] = "ms"
        del stamps[:], values[:]

    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        number = 0
        while line := stream.readline(_LONGEST_LINE):
            number += 1
            if line.startswith(";"):
                cells = [cell.strip() for cell in line.split(";")]
                if not name or (len(cells) < 3 and not any(cells)):
                    continue
                try:
                    stamp, value = float(cells[1]), _number(cells[2])
                except (ValueError, IndexError):
                    raise InputError(
                        f"{path}: line {number} of {name!r} is {line.strip()[:40]!r}, not a stamp and a"
                        " value; correct the file"
                    ) from None
                stamps.append(stamp)
                values.append(value)
            elif match := _VARIABLE.fullmatch(line.strip()):
                finish()
                name = match[2] or match[1]
                if name in table.columns:
                    name = f"{name} ({match[1]})"
                if len(table.columns) > MOST_COLUMNS:
                    raise InputError(f"{path}: more than {MOST_COLUMNS:,} columns; check that this is the data file")
        finish()
    if not table.columns:
        raise InputError(f"{path}: a trace of CODESYS without values; check that it was saved after it had run")
    table.notes.append("the stamps of a trace are taken as ms; of one with µs set `time:` of each signal")
    return table


def _number(text: str) -> float:
    return _WORDS[text] if text in _WORDS else float(text.replace(",", "."))


def _is_codesys(head: bytes) -> bool:
    lines = text_of(head).lstrip().splitlines()
    return bool(lines) and (
        _HEAD.match(lines[0]) is not None and any(_VARIABLE.fullmatch(line.strip()) for line in lines)
    )


FORM = Form(
    "codesys",
    (".trace.csv",),
    "trace of CODESYS, saved as text",
    "variables by name, each with its own stamps in `name.time` [ms]",
    _is_codesys,
    read_codesys,
)
