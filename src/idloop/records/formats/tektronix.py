"""Files of older oscilloscopes of Tektronix: keys and their values beside the first rows, stamps and readings behind.

The TDS 1000, 2000 and 3000 series save a file for each channel, such as ``F0000CH1.CSV``. Each of the first rows is
key, value, unit, stamp, reading; in the rows below the first three are empty.
"""

from __future__ import annotations

import csv
from itertools import islice
from pathlib import Path

from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.text_table import read_text_table
from idloop.records.tables.csv_layout import is_number
from idloop.records.tables.table import Table

_FIRST = "record length"
_BESIDE = 3  # columns of keys, values and units
_LINES = 40  # among which the keys stand
_SOURCE, _TIME = "source", "time"


def read_tektronix(path: Path, options: Options) -> Table:
    """Read the stamps and the readings beside the keys.

    Raises InputError: nothing stands behind the keys.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
        try:
            keys = _keys(list(islice(stream, _LINES)))
        except csv.Error as error:
            raise InputError(f"{path}: its settings cannot be read ({error}); save the waveform again") from None
    table = read_text_table(path, {**options, "skip_rows": 0, "header": False, "delimiter": ","})
    stamps, *readings = list(table.columns.values())[_BESIDE:] or [None]
    if stamps is None or not readings:
        raise InputError(f"{path}: no stamps and readings stand beside the keys; save the waveform again")
    names = [keys.get(_SOURCE, "CH1")] if len(readings) == 1 else [f"CH{k}" for k in range(1, len(readings) + 1)]
    table.columns = {_TIME: stamps, **dict(zip(names, readings, strict=True))}
    table.units = {_TIME: keys.get("horizontal units", "s")} | dict.fromkeys(names, keys.get("vertical units", ""))
    table.attributes = {key: float(value) for key, value in keys.items() if is_number(value)}
    return table


def _keys(lines: list[str]) -> dict[str, str]:
    """What the first rows say, by key in small letters."""
    rows = ([cell.strip() for cell in row] for row in csv.reader(lines, skipinitialspace=True))
    return {row[0].lower(): row[1] for row in rows if len(row) > 1 and row[0]}


def _is_tektronix(head: bytes) -> bool:
    row = next(csv.reader(text_of(head).splitlines()[:1], skipinitialspace=True), [])
    behind = [cell for cell in map(str.strip, row[_BESIDE:]) if cell]
    return row[:1] != [] and row[0].strip().lower() == _FIRST and len(behind) > 1 and all(map(is_number, behind))


FORM = Form(
    "tektronix",
    (),
    "waveform of an older oscilloscope of Tektronix, its settings beside the first rows",
    "`time`, and the channel by its name: `CH1`",
    _is_tektronix,
    read_tektronix,
)
