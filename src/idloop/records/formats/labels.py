"""Text of labelled values: of serial plotters, console logs and Teleplot, read line by line."""

from __future__ import annotations

import re
from array import array
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, check_size, is_row, lines_of, text_of
from idloop.records.tables.base_units import known_unit
from idloop.records.tables.table import Table
from idloop.spelling import counted, is_or_are

_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan|inf(?:inity)?)"
_PAIR = re.compile(rf"([^\W\d][^:=,;|\t]*?)\s*[:=]\s*({_NUMBER})\s*§?\s*([^\s\d:=,;|.+-]\S*)?", re.IGNORECASE)
# A label with something else than a number, such as `state=RUN`.
_TEXT = re.compile(r"[^\W\d][^\s:=,;|]*\s*[:=]\s*\S+")
_CELLS = re.compile(r"\s*[,;\t|]\s*")
_BLANKS = re.compile(r"\s+(?=[^\W\d][^\s:=]*\s*[:=])")
# Before the values, what says most of the time first; then numbers in brackets, and others.
_CLOCK = r"\d{1,2}:\d\d:\d\d(?:[.,:]\d+)?"
_STAMPS = tuple(map(re.compile, (
    rf"(?P<stamp>\d{{4}}-\d\d-\d\d[T ]{_CLOCK}(?:Z|[-+]\d\d:?\d\d)?)(?P<unit>)",
    rf"(?P<stamp>{_CLOCK})(?P<unit>)",
    r"[\[(]\s*(?P<stamp>\d+(?:\.\d+)?)\s*(?P<unit>[mµun]?s)?\s*[\])]",
    r"(?:^|(?<![:=\s])\s+)(?P<stamp>\d+(?:\.\d+)?)\s*(?P<unit>[mµun]?s)?(?=[\s,;:|>])",
)))  # fmt: skip
# Of a dictionary as Python prints it.
_MARKS = str.maketrans("", "", "{}'\"")
# Of Teleplot: `>name:value`, `>name:stamp:value§unit|flags`, several values apart by semicolons; stamps are in ms.
_TELEPLOT = re.compile(r">\s*([^:|]+):([^|§]+)(?:§([^|]*))?(?:\|(\w*))?")
_NO_SERIES = ("t", "xy")
_CLOCK_NAME = "time"
_LEAST, _MOST = 3, 200  # lines by which a file is recognised


@dataclass(frozen=True)
class Reading:
    """One value."""

    label: str
    value: float
    # When it was taken, and the unit of that; empty where the line does not say it
    stamp: str = ""
    clock: str = ""
    unit: str = ""  # as the line writes it


def readings(line: str) -> list[Reading]:
    """Return the values of a line; none where something else stands among them, or a label twice.

    Examples
    --------
    >>> [(one.label, one.value, one.stamp) for one in readings("[09:00:00.5] INFO motor: pos=1.2 vel=0.3")]
    [('pos', 1.2, '09:00:00.5'), ('vel', 0.3, '09:00:00.5')]
    """
    text = line.translate(_MARKS).strip()
    if text.startswith(">"):
        return _teleplot(text) or _pairs(text[1:])
    for form in _STAMPS:
        match = form.search(text)
        if match is None or _pairs(text[: match.start()]):
            continue
        stamp, clock = match["stamp"].replace(",", "."), (match["unit"] or "").replace("µ", "u")
        if found := _pairs(text[match.end() :].lstrip(" \t])>|:;,-")):
            return [Reading(one.label, one.value, stamp, clock, one.unit) for one in found]
    return _pairs(text)


def _pairs(text: str) -> list[Reading]:
    """Values behind labels; what stands before the first of them does not count."""
    head, *cells = map(str.strip, _CELLS.split(text.rstrip(",;| \t")))
    parts = [*([head] if _PAIR.fullmatch(head) and cells else _BLANKS.split(head)), *cells]
    words = len(parts) - len(cells) - bool(cells)  # that may stand before the first of them
    found: dict[str, Reading] = {}
    for place, part in enumerate(parts):
        match = _PAIR.fullmatch(part)
        if match is None or (match[3] and not known_unit(match[3])):
            if (found or place >= words) and not _TEXT.fullmatch(part):
                return []
            continue
        if match[1] in found:
            return []
        found[match[1]] = Reading(match[1], float(match[2]), unit=match[3] or "")
    return list(found.values())


def _teleplot(text: str) -> list[Reading]:
    match = _TELEPLOT.fullmatch(text)
    if match is None or match[4] in _NO_SERIES:
        return []
    found = []
    for point in match[2].split(";"):
        *stamp, value = map(str.strip, point.split(":"))
        if len(stamp) > 1 or not all(re.fullmatch(_NUMBER, one, re.IGNORECASE) for one in (*stamp, value)):
            return []
        found.append(Reading(match[1], float(value), "".join(stamp), "ms" if stamp else "", match[3] or ""))
    return found


def read_labels(path: Path, _: Options) -> Table:
    """Read the labelled values of a file.

    Where lines say when they were written, a label has the stamps of its lines. Without stamps a row begins with the
    first label of the file and with each that comes again; a label that a row lacks was not measured.
    """
    check_size(path, "keep fewer lines", MOST_TABLE // 8)
    found: dict[str, _Label] = {}
    row, in_row = -1, set[str]()
    count = others = 0
    clock = ""
    for line in lines_of(path):
        several = readings(line)
        others += not several and bool(line.strip())
        count += len(several)
        for one in several:
            label = found.setdefault(one.label, _Label())
            if one.label in in_row or one.label == next(iter(found)):
                row, in_row = row + 1, set()
            in_row.add(one.label)
            label.values.append(one.value)
            label.rows.append(row)
            label.stamps.append(one.stamp)
            label.unit = label.unit or one.unit
            clock = clock or one.clock
        if len(found) > MOST_COLUMNS or 64 * count > MOST_TABLE:
            raise InputError(f"{path}: too many labels or lines; check that this is the data file")
    table = Table(path, {}, units={name: one.unit for name, one in found.items() if one.unit})
    stamped = all(all(one.stamps) for one in found.values()) and _CLOCK_NAME not in found
    if stamped and any(one.stamps[0] != one.stamps[-1] for one in found.values()):
        table.set_series({name: (one.clock(), np.array(one.values)) for name, one in found.items()}, _CLOCK_NAME, clock)
    else:
        for name, label in found.items():
            table.columns[name] = np.full(row + 1, np.nan)
            table.columns[name][np.array(label.rows)] = label.values
    if others:
        table.notes.append(f"{counted(others, 'line')} without labelled values {is_or_are(others)} left out")
    return table


@dataclass
class _Label:
    """The values of one label, with the stamps and the rows at which they stand."""

    values: array[float] = field(default_factory=lambda: array("d"))
    rows: array[int] = field(default_factory=lambda: array("q"))
    stamps: list[str] = field(default_factory=list)
    unit: str = ""

    def clock(self) -> Any:
        """Stamps as numbers where they are; times of day and dates as they stand there."""
        try:
            return np.array(self.stamps, dtype=np.float64)
        except ValueError:
            return self.stamps


def _is_labels(head: bytes) -> bool:
    """Whether more lines of a text have values by labels that come again than rows of numbers."""
    lines = [line for line in text_of(head).splitlines()[:_MOST] if line.strip() and len(line) < 1 << 16]
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
