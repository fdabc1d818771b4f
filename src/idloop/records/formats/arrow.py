"""Parquet files and files of Arrow (Feather version 2, IPC), read piece by piece.

Read by pyarrow, the reference implementation of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_COLUMNS, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, needs, not_readable
from idloop.records.formats.isolated import read_isolated
from idloop.records.tables.base_units import is_unit_key
from idloop.records.tables.table import Table
from idloop.spelling import listed

_STREAM = b"\xff\xff\xff\xff"
_MOST_ROWS = 65_536  # of a piece
_TEXT = 64  # bytes of a cell as a text
_LIST = 64  # longest list of a fixed size that becomes columns
_PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}


def read_parquet(path: Path, _: Options) -> Table:
    """Read the columns of a Parquet file."""

    def pieces() -> tuple[Any, Iterator[Any]]:
        from pyarrow import parquet

        file = parquet.ParquetFile(path, memory_map=False)
        return file.schema_arrow, file.iter_batches(batch_size=_MOST_ROWS, use_threads=False)

    return _read(path, "Parquet", pieces)


def read_feather(path: Path, _: Options) -> Table:
    """Read the columns of a file of Arrow."""
    with path.open("rb") as stream:
        head = stream.read(4)
    if head == b"FEA1":
        # Its reader trusts what the file says: damaged ones end the process.
        raise InputError(
            f"{path}: a Feather file of version 1; save it again as version 2, with pyarrow.feather.write_feather"
        )

    def pieces() -> tuple[Any, Iterator[Any]]:
        from pyarrow import OSFile, ipc

        options = ipc.IpcReadOptions(use_threads=False)
        if head == _STREAM:
            reader = ipc.open_stream(OSFile(str(path), "rb"), options=options)
            return reader.schema, iter(reader)
        file = ipc.open_file(OSFile(str(path), "rb"), options=options)
        return file.schema, (file.get_batch(number) for number in range(file.num_record_batches))

    return _read(path, "Arrow", pieces)


def _read(path: Path, what: str, pieces: Callable[[], tuple[Any, Iterator[Any]]]) -> Table:
    try:
        import pyarrow as pa  # noqa: F401 - each process that reads a file then has it
    except ImportError:
        raise needs(path, "pyarrow") from None

    def read() -> Any:
        try:
            return _columns(path, *pieces())
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - the library lets those of Arrow, of codecs and of Python through
            raise not_readable(path, what, error) from None

    columns, units, skipped = read_isolated(path, what, read)
    notes = [f"columns that hold neither numbers nor texts are left out: {listed(skipped)}"] if skipped else []
    return Table(path, columns, units=units, notes=notes)


def _columns(path: Path, schema: Any, batches: Iterator[Any]) -> tuple[dict[str, Any], dict[str, str], list[str]]:
    """Columns by name, their units, and the names of those that are left out."""
    import pyarrow as pa

    parts: dict[str, list[Any]] = {}
    units: dict[str, str] = {}
    skipped: dict[str, None] = {}
    size = 0
    _check(path, len(schema), 0)
    for batch in batches:
        batch.validate(full=True)
        _check(path, 0, batch.nbytes)
        flat = pa.Table.from_batches([batch])
        for _ in range(3):
            flat = flat.flatten()
        for field, column in zip(flat.schema, flat.columns, strict=True):
            values = _values(column.combine_chunks(), pa)
            if values is None:
                skipped[field.name] = None
            for name, one in values or []:
                full = field.name + name
                parts.setdefault(full, []).append(one)
                size += one.nbytes if isinstance(one, np.ndarray) else _TEXT * len(one)
                units |= _unit(full, field)
        _check(path, len(parts), size)
    columns = {
        name: np.concatenate(several) if all(isinstance(one, np.ndarray) for one in several)
        else [cell for one in several for cell in one]
        for name, several in parts.items()
    }  # fmt: skip
    return columns, units, list(skipped)


def _check(path: Path, columns: int, size: int) -> None:
    if columns > MOST_COLUMNS:
        raise InputError(f"{path}: {columns:,} columns, more than {MOST_COLUMNS:,}; keep fewer")
    if size > MOST_TABLE:
        raise InputError(f"{path}: its columns take more than {MOST_TABLE >> 30} GiB; keep fewer")


def _values(column: Any, pa: Any) -> list[tuple[str, Any]] | None:
    """Values of a column, with what its name gets behind it; None for what is neither numbers nor texts."""
    kind, types = column.type, pa.types
    if types.is_dictionary(kind):
        column = column.dictionary_decode()
        kind = column.type
    if types.is_fixed_size_list(kind) and 0 < kind.list_size <= _LIST:
        inner = _values(column.flatten(), pa)
        if not inner or column.null_count or len(inner[0][1]) != len(column) * kind.list_size:
            return None
        return [(f"[{place}]", inner[0][1][place :: kind.list_size]) for place in range(kind.list_size)]
    if types.is_temporal(kind):
        return [("", _seconds(column, pa))] if _is_counted(kind, types) else None
    if types.is_decimal(kind) or types.is_boolean(kind):
        column = column.cast(pa.float64() if types.is_decimal(kind) else pa.int8())
    elif types.is_string(kind) or types.is_large_string(kind):
        return [("", column.to_pylist())]
    elif not (types.is_integer(kind) or types.is_floating(kind)):
        return None
    return [("", np.asarray(column.to_numpy(zero_copy_only=False)))]


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
    "columns by name, fields of a structure `a.b`, dates as seconds since 1970, spans and times of day as seconds",
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
