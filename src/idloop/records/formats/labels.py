"""Text of labelled values, such as a serial plotter draws: ``angle:1.25,speed:0.5`` or ``angle:1.25 speed:0.5``."""

from __future__ import annotations

import re
from array import array
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.tables.table import Table

_PAIR = re.compile(
    r"\s*([^\W\d][^:,;\t]*?)\s*:\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|[-+]?(?:nan|inf)\w*)\s*", re.IGNORECASE
)
# Time of day that a serial monitor writes before each line.
_STAMP = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]?\d*)\s*->\s*")
_STAMPS = "time"
_LONGEST_LINE = 1 << 16
_LEAST, _MOST = 3, 200  # lines by which a file is recognised


def read_labels(path: Path, _: Options) -> Table:
    """Read the labelled values of a file; a label that a line lacks was not measured.

    Raises
    ------
    InputError
        The file is too large.
    """
    if path.stat().st_size > MOST_TABLE // 8:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 23} MiB; keep fewer lines")
    columns: dict[str, array[float]] = {}
    stamps: list[str] = []
    count = others = 0
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        for line in iter(lambda: stream.readline(_LONGEST_LINE), ""):
            stamp = _STAMP.match(line)
            pairs = _pairs(line[stamp.end() :] if stamp else line)
            if not pairs:
                others += bool(line.strip())
                continue
            for label, value in pairs.items():
                column = columns.setdefault(label, array("d"))
                column.extend([np.nan] * (count - len(column)))
                column.append(value)
            stamps.append(stamp[1] if stamp else "")
            count += 1
            if len(columns) > MOST_COLUMNS or 8 * count * len(columns) > MOST_TABLE:
                raise InputError(f"{path}: too many labels or lines; check that this is the data file")
    found: dict[str, Any] = {_STAMPS: stamps} if stamps and all(stamps) and _STAMPS not in columns else {}
    for label, column in columns.items():
        column.extend([np.nan] * (count - len(column)))
        found[label] = np.frombuffer(column, dtype=np.float64)
    left = "1 line without labelled values is" if others == 1 else f"{others} lines without labelled values are"
    return Table(path, found, notes=[f"{left} left out"] if others else [])


def _pairs(line: str) -> dict[str, float]:
    """Values of a line by their labels; empty where something else stands there, or a label twice."""
    text = line.strip().rstrip(",;")
    parts = re.split(r"[,;\t]", text) if re.search(r"[,;\t]", text) else re.sub(r"\s*:\s*", ":", text).split()
    matches = [_PAIR.fullmatch(part) for part in parts]
    try:
        found = {match[1]: float(match[2]) for match in matches if match is not None}
    except ValueError:
        return {}
    return found if len(found) == len(parts) else {}


def _is_labels(head: bytes) -> bool:
    """Whether most lines of a text have values by the same labels."""
    lines = [_STAMP.sub("", line) for line in text_of(head).splitlines()[:_MOST] if line.strip()]
    labels = Counter(tuple(pairs) for line in lines if len(line) < _LONGEST_LINE and (pairs := _pairs(line)))
    most = labels.most_common(1)
    return bool(most) and most[0][1] >= _LEAST and 2 * most[0][1] > len(lines)


FORM = Form(
    "labels",
    (),
    "text of labelled values, as of a serial plotter: `angle:1.25,speed:0.5`",
    "by the labels; the times of day of a serial monitor `time`",
    _is_labels,
    read_labels,
)
