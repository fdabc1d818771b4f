"""Files of any form that is known, as named columns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.registry import form_of
from idloop.records.tables.reshaping import join_stamps, spread_names, turn_rows
from idloop.records.tables.table import Table
from idloop.records.tables.text_cells import read_texts
from idloop.spelling import did_you_mean, listed

__all__ = ["Table", "read_table"]


def read_table(path: Path, kind: str | None = None, options: Mapping[str, Any] | None = None) -> Table:
    """Read a file into columns.

    `path`: the file.
    `kind`: form, one of `idloop.records.formats.registry.kinds`; by default found out from its first bytes and its
    suffix.
    `options`: ``delimiter``, ``header``, ``skip_rows``, ``decimal``, ``skip_text``, ``rows`` (csv: slice of the rows of
    data that are looked at); ``entries`` (json, torch: key of the list of samples).
    Raises InputError: missing or unreadable file, unknown form, no rows.
    """
    if path.exists() and not path.is_file():
        what = "a directory" if path.is_dir() else "no regular file"
        raise InputError(f"{path}: {what}; name the file that holds the data")
    if not path.is_file():
        near = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
        raise InputError(f"{path}: no such file{did_you_mean(path.name, near) or '; check the path'}")
    try:
        table = form_of(path, kind).read(path, dict(options or {}))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    read_texts(table)
    if not table.columns:
        raise InputError(f"{path}: no columns of numbers found; check that this is the data file")
    # Elements without a size may form an array of any length.
    if 8 * sum(len(column) for column in table.columns.values()) > MOST_TABLE:
        raise InputError(f"{path}: its columns take more than {MOST_TABLE >> 30} GiB; cut the file")
    if not any(len(column) for column in table.columns.values()):
        raise InputError(
            f"{path}: there are no rows of data, only the names of columns ({listed(table.columns)});"
            " check that the recording was saved whole"
        )
    if table.text is not None:
        turn_rows(table)
    spread_names(table)
    join_stamps(table)
    return table
