"""Parquet files and files of Arrow (Feather version 2, IPC).

Read by pyarrow, the reference implementation of both.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, needs
from idloop.records.formats.isolated import read_isolated
from idloop.records.tables.base_units import is_unit_key
from idloop.records.tables.table import Table
from idloop.spelling import listed

_STREAM = b"\xff\xff\xff\xff"
_LIST = 64  # longest list of one length in all rows that becomes columns
_PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}


def read_parquet(path: Path, _: Options) -> Table:
    """Read the columns of a Parquet file."""

    def load() -> Any:
        from pyarrow import parquet

        file = parquet.ParquetFile(path, memory_map=False)
        # Values that are all the same take a few bytes of the file for any number of rows.
        if file.metadata.num_rows * file.metadata.num_columns > MOST_TABLE:
            raise _too_large(path)
        return file.read(use_threads=False)

    return _read(path, "Parquet", load)


def read_feather(path: Path, _: Options) -> Table:
    """Read the columns of a file of Arrow."""
    with path.open("rb") as stream:
        head = stream.read(4)
    if head == b"FEA1":
        # Its reader trusts what the file says: damaged ones end the process.
        raise InputError(
            f"{path}: a Feather file of version 1; save it again as version 2, with pyarrow.feather.write_feather"
        )

    def load() -> Any:
        from pyarrow import OSFile, ipc

        opened = ipc.open_stream if head == _STREAM else ipc.open_file
        return opened(OSFile(str(path), "rb"), options=ipc.IpcReadOptions(use_threads=False)).read_all()

    return _read(path, "Arrow", load)


def _read(path: Path, what: str, load: Callable[[], Any]) -> Table:
    try:
        import pyarrow as pa  # noqa: F401 - each process that reads a file then has it
    except ImportError:
        raise needs(path, "pyarrow") from None
    columns, units, skipped = read_isolated(path, what, lambda: _columns(path, load()))
    notes = [f"columns that hold neither numbers nor texts are left out: {listed(skipped)}"] if skipped else []
    return Table(path, columns, units=units, notes=notes)


def _too_large(path: Path) -> InputError:
    return InputError(f"{path}: its columns take more than {MOST_TABLE >> 30} GiB; keep fewer")


def _columns(path: Path, table: Any) -> tuple[dict[str, Any], dict[str, str], list[str]]:
    """Columns by name, their units, and the names of those that are left out."""
    import pyarrow as pa

    if table.nbytes > MOST_TABLE:
        raise _too_large(path)
    table.validate(full=True)
    for _ in range(3):
        table = table.flatten()
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    skipped: list[str] = []
    for field, column in zip(table.schema, table.columns, strict=True):
        values = _values(column.combine_chunks(), pa)
        skipped += [field.name] if values is None else []
        for name, one in values or []:
            columns[field.name + name] = one
            units |= _unit(field.name + name, field)
        if len(columns) > MOST_COLUMNS:
            raise InputError(f"{path}: more than {MOST_COLUMNS:,} columns; keep fewer")
    return columns, units, skipped


def _values(column: Any, pa: Any) -> list[tuple[str, Any]] | None:
    """Values of a column, with what its name gets behind it; None for what is neither numbers nor texts."""
    kind, types = column.type, pa.types
    if types.is_dictionary(kind):
        column = column.dictionary_decode()
        kind = column.type
    if size := _list_size(column, types):
        inner = _values(column.flatten(), pa)
        if not inner or column.null_count or len(inner[0][1]) != len(column) * size:
            return None
        return [(f"[{place}]", inner[0][1][place::size]) for place in range(size)]
    if types.is_temporal(kind):
        return [("", _seconds(column, pa))] if _is_counted(kind, types) else None
    if types.is_decimal(kind) or types.is_boolean(kind):
        column = column.cast(pa.float64() if types.is_decimal(kind) else pa.int8())
    elif types.is_string(kind) or types.is_large_string(kind):
        return [("", column.to_pylist())]
    elif not (types.is_integer(kind) or types.is_floating(kind)):
        return None
    return [("", np.asarray(column.to_numpy(zero_copy_only=False)))]


def _list_size(column: Any, types: Any) -> int:
    """Length of the lists of a column; 0 where it holds none, or of several lengths, or too long ones."""
    kind = column.type
    size = 0
    if types.is_fixed_size_list(kind):
        size = kind.list_size
    elif types.is_list(kind) or types.is_large_list(kind):
        # As pandas and data sets for learning write them: nothing but the lists says that all are as long.
        lengths = set(column.value_lengths().unique().to_pylist())
        size = lengths.pop() or 0 if len(lengths) == 1 else 0
    return size if size <= _LIST else 0


def _is_counted(kind: Any, types: Any) -> bool:
    """Whether a column counts a unit of time: a date with its time, a span or a time of day."""
    return bool(types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind))


def _seconds(column: Any, pa: Any) -> Array:
    """Times [s], whatever the column counts; whole seconds and the rest apart, so that each is rounded once."""
    narrow = column.cast(pa.int32()) if column.type.bit_width == 32 else column
    counted, per = narrow.cast(pa.int64()), _PER_SECOND[column.type.unit]
    known = np.asarray(counted.fill_null(0).to_numpy(zero_copy_only=False), dtype=np.int64)
    whole, rest = np.divmod(known, per)
    return np.where(np.asarray(column.is_null()), np.nan, whole + rest / per)


def _unit(name: str, field: Any) -> dict[str, str]:
    import pyarrow as pa

    if _is_counted(field.type, pa.types):
        return {name: "s"}
    kept = {key.decode("utf-8", "replace"): value for key, value in (field.metadata or {}).items()}
    unit = next((value for key, value in kept.items() if is_unit_key(key)), b"")
    return {name: unit.decode("utf-8", "replace")} if unit else {}


PARQUET = Form(
    "parquet",
    (".parquet", ".pq"),
    "Parquet",
    "columns by name, fields of a structure `a.b`, elements of lists of one length `a[0]`, dates as seconds since 1970,"
    " spans and times of day as seconds",
    lambda head: head.startswith(b"PAR1"),
    read_parquet,
)
FEATHER = Form(
    "feather",
    (".feather", ".arrow", ".arrows", ".ipc"),
    "Arrow and Feather version 2",
    "as of Parquet",
    lambda head: head.startswith((b"ARROW1", b"FEA1", _STREAM)),
    read_feather,
)
