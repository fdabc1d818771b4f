"""Text files with a table: read by `idloop.records.tables.csv_file`, whose layout is found out."""

from __future__ import annotations

import re
from pathlib import Path

from idloop.records.formats.form import Form, Options, text_of
from idloop.records.tables.csv_file import read_csv
from idloop.records.tables.table import Table

_ROW = re.compile(
    r"\s*[\[(]?\s*[-+]?[\d.,]+(?:e[-+]?\d+)?(?:[\s;,|]+[-+]?[\d.,]+(?:e[-+]?\d+)?)*[\s;,]*[\])]?\s*", re.IGNORECASE
)


def read_text_table(path: Path, options: Options) -> Table:
    """Read a table of text.

    `options`: ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``, ``rows`` (slice of the rows of data
    that are looked at).
    Raises InputError: it is no such table, or too large.
    """
    rows = options.get("rows") or slice(0, None)
    read = read_csv(path, dict(options), rows)
    return Table(
        path,
        read.columns,
        notes=read.notes,
        units=read.units,
        attributes=read.attributes,
        clocks=read.clocks,
        first_row=rows.start or 0,
        csv=read,
    )


def is_row(line: str) -> bool:
    """Whether a line is a row of numbers."""
    return len(line) < 1_000 and _ROW.fullmatch(line) is not None


def _is_table(head: bytes) -> bool:
    """Whether a text has rows of numbers."""
    return sum(map(is_row, text_of(head)[:20_000].splitlines())) >= 2


FORM = Form(
    "csv",
    (".csv", ".txt", ".tsv", ".dat", ".log", ".asc", ".prn"),
    "a table of text",
    'by the header, or `"0"`, `"1"`, ... without one, or by words that stand before the numbers in every row',
    _is_table,
    read_text_table,
)
