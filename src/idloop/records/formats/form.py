"""What a form of log file is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from idloop.errors import InputError
from idloop.records.tables.table import Table

Options = Mapping[str, Any]


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
    if b"\0" in head:
        return ""
    return head.decode("utf-8-sig", errors="replace")


def needs(path: Path, library: str) -> InputError:
    """Return the error of a file whose reader is not installed."""
    return InputError(f"{path}: {library} reads this form and is not installed; run: pip install 'idloop[formats]'")
