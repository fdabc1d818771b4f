"""Text of labelled values: of serial plotters, console logs and Teleplot, read line by line."""

from __future__ import annotations

from array import array
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.labelled_line import Reading, readings
from idloop.records.formats.text_table import is_row
from idloop.records.tables.series import set_series
from idloop.records.tables.table import Table

_STAMPS = "time"
_LONGEST_LINE = 1 << 16
_LEAST, _MOST = 3, 200  # lines by which a file is recognised


def read_labels(path: Path, _: Options) -> Table:
    """Read the labelled values of a file.

    Where lines say when they were written, a label has the stamps of its lines. Without stamps a row begins with the
    first label of the file and with each that comes again; a label that a row lacks was not measured.

    Raises InputError: the file is too large.
    """
    if path.stat().st_size > MOST_TABLE // 8:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 23} MiB; keep fewer lines")
    found = _Readings(path)
    others = 0
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        for line in iter(lambda: stream.readline(_LONGEST_LINE), ""):
            several = readings(line)
            found.add(several)
            others += not several and bool(line.strip())
    left = "1 line without labelled values is" if others == 1 else f"{others} lines without labelled values are"
    table = found.table()
    table.notes += [f"{left} left out"] if others else []
    return table


class _Readings:
    """The values read so far, by label."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._values: dict[str, array[float]] = {}
        self._stamps: dict[str, list[str]] = {}
        self._rows: dict[str, array[int]] = {}
        self._units: dict[str, str] = {}
        self._clock = ""
        self._row, self._in_row = -1, set[str]()
        self._unstamped, self._count = False, 0

    def add(self, several: list[Reading]) -> None:
        """Add the values of a line."""
        for one in several:
            if one.label in self._in_row or one.label == next(iter(self._values), one.label):
                self._row, self._in_row = self._row + 1, set()
            self._in_row.add(one.label)
            self._values.setdefault(one.label, array("d")).append(one.value)
            self._rows.setdefault(one.label, array("q")).append(self._row)
            self._stamps.setdefault(one.label, []).append(one.stamp)
            self._unstamped = self._unstamped or not one.stamp
            self._clock = self._clock or one.clock
            if one.unit:
                self._units.setdefault(one.label, one.unit)
        self._count += len(several)
        if len(self._values) > MOST_COLUMNS or 64 * self._count > MOST_TABLE:
            raise InputError(f"{self._path}: too many labels or lines; check that this is the data file")

    def table(self) -> Table:
        """Return what was read."""
        table = Table(self._path, {}, units=dict(self._units))
        values = {label: np.frombuffer(column, dtype=np.float64) for label, column in self._values.items()}
        moving = any(stamps[0] != stamps[-1] for stamps in self._stamps.values())
        if moving and not self._unstamped and _STAMPS not in values:
            series = {label: (_numbers(self._stamps[label]), column) for label, column in values.items()}
            set_series(table, series, _STAMPS, self._clock)
            return table
        for label, column in values.items():
            table.columns[label] = np.full(self._row + 1, np.nan)
            table.columns[label][np.frombuffer(self._rows[label], dtype=np.int64)] = column
        return table


def _numbers(stamps: list[str]) -> Any:
    """Stamps as numbers where they are; times of day and dates as they stand there."""
    try:
        return np.array(stamps, dtype=np.float64)
    except ValueError:
        return stamps


def _is_labels(head: bytes) -> bool:
    """Whether more lines of a text have values by labels that come again than rows of numbers."""
    lines = [line for line in text_of(head).splitlines()[:_MOST] if line.strip() and len(line) < _LONGEST_LINE]
    labelled = [{one.label for one in readings(line)} for line in lines]
    counts = Counter(label for labels in labelled for label in labels)
    again = [labels for labels in labelled if labels and all(counts[label] >= _LEAST for label in labels)]
    return len(again) > sum(map(is_row, lines))


FORM = Form(
    "labels",
    (),
    "text of labelled values, as of a serial plotter, a console or Teleplot: `angle:1.25,speed:0.5`,"
    " `[09:00:00.5] INFO angle=1.25 speed=0.5`, `>angle:1627551892437:1.25§rad`",
    "by the labels; the stamps of the lines `time`, or `angle.time` where labels stand in lines of their own",
    _is_labels,
    read_labels,
)
