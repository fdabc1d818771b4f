"""What a form of log file is, and the table of text that many of them are."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.tables.csv_file import read_csv
from idloop.records.tables.table import Table

Options = Mapping[str, Any]
_ROW = re.compile(
    r"\s*[\[(]?\s*[-+]?[\d.,]+(?:e[-+]?\d+)?(?:[\s;,|]+[-+]?[\d.,]+(?:e[-+]?\d+)?)*[\s;,]*[\])]?\s*", re.IGNORECASE
)
_LONGEST_LINE = 1 << 16


@dataclass(frozen=True)
class Form:
    """One form of log file."""

    kind: str  # its name, as ``format:`` of a mapping file
    suffixes: tuple[str, ...]  # of its files, in small letters
    about: str  # what it is, in a few words
    columns: str  # how its columns are named
    sniff: Callable[[bytes], bool]  # whether the first bytes of a file (at most `HEAD`) are of this form
    read: Callable[[Path, Options], Table]  # reads a file; `InputError` for one that is damaged
    # Whether a file is of this form that its first bytes do not show yet; asked of files of text that no other form
    # claims
    sniff_on: Callable[[Path], bool] = lambda _: False


def text_of(head: bytes) -> str:
    """Return the beginning of a file as text; empty where it is binary."""
    return "" if b"\0" in head else head.decode("utf-8-sig", errors="replace")


def lines_of(path: Path) -> Iterator[str]:
    """Yield the lines of a text file with their ends; a line of no end comes in pieces."""
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        yield from iter(lambda: stream.readline(_LONGEST_LINE), "")


def check_size(path: Path, advice: str, most: int = MOST_TABLE) -> None:
    """Refuse a file of more than `most` bytes with the advice what to do."""
    if path.stat().st_size > most:
        size = f"{most >> 30} GiB" if most >> 30 else f"{most >> 20} MiB"
        raise InputError(f"{path}: the file has more than {size}; {advice}")


def needs(path: Path, library: str) -> InputError:
    """Return the error of a file whose reader is not installed."""
    return InputError(f"{path}: {library} reads this form and is not installed; run: pip install 'idloop[formats]'")


def not_readable(path: Path, what: str, error: object) -> InputError:
    """Return the error of a file that its library cannot read, as one line."""
    return InputError(f"{path}: not a readable {what} file ({reason_of(error, 120)}); check the copy of the file")


def reason_of(error: object, most: int) -> str:
    """Return what an error says as one line of at most `most` characters."""
    return " ".join(str(error).split())[:most] or type(error).__name__


def read_text_table(path: Path, options: Options) -> Table:
    """Read a table of text whose layout is found out; options as of `read_csv`, and ``rows`` that are read."""
    return read_csv(path, dict(options), options.get("rows") or slice(0, None))


def is_row(line: str) -> bool:
    """Whether a line is a row of numbers."""
    return len(line) < 1_000 and _ROW.fullmatch(line) is not None


TEXT = Form(
    "csv",
    (".csv", ".txt", ".tsv", ".dat", ".log", ".asc", ".prn"),
    "a table of text",
    'by the header, or `"0"`, `"1"`, ... without one, or by words that stand before the numbers in every row',
    lambda head: sum(map(is_row, text_of(head)[:20_000].splitlines())) >= 2,
    read_text_table,
)
