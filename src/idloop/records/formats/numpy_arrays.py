"""Arrays of NumPy: one in a .npy file, several in a .npz archive; pickled objects are never opened."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from idloop.documents import MOST_TABLE, read_npz
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, not_readable
from idloop.records.formats.tree import table_of_tree
from idloop.records.tables.table import Table
from idloop.spelling import listed

_OBJECTS = (
    "it holds pickled objects of Python, which are never opened; save plain arrays:"
    " numpy.savez('log.npz', t=t, u=u, y=y)"
)


def read_npz_table(path: Path, _: Options) -> Table:
    """Read the arrays of an archive; what are objects of Python, such as settings beside the data, is left out."""
    objects: list[str] = []
    arrays = read_npz(path, MOST_TABLE, objects)
    if objects and not arrays:
        raise InputError(f"{path}: {_OBJECTS}")
    table = table_of_tree(path, arrays)
    if objects:
        table.notes.append(f"objects of Python are never opened, and left out: {listed(objects)}")
    return table


def read_npy_table(path: Path, _: Options) -> Table:
    """Read one array: its columns by position, or its fields by name."""
    try:
        with path.open("rb") as stream:
            version = np.lib.format.read_magic(stream)
            header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _fortran, kind = header(stream)
            stated = math.prod(shape) * max(kind.itemsize, 1)
            if stated <= MOST_TABLE and not kind.hasobject:
                stream.seek(0)
                array = np.lib.format.read_array(stream, allow_pickle=False)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    except Exception as error:  # noqa: BLE001 - the header is a text that is evaluated
        raise not_readable(path, "NPY", error) from None
    if kind.hasobject:
        raise InputError(f"{path}: {_OBJECTS}")
    if stated > MOST_TABLE:
        raise InputError(
            f"{path}: it takes {stated / 2**30:.3g} GiB, more than {MOST_TABLE / 2**30:.3g}; keep fewer rows"
        )
    if array.dtype.names:
        return table_of_tree(path, {name: array[name] for name in array.dtype.names})
    table = table_of_tree(path, {"": array})
    table.columns = {name.strip("[]") or "0": column for name, column in table.columns.items()}
    return table


FORM = Form(
    "npz",
    (".npz",),
    "arrays of NumPy",
    "arrays by name, the columns of a matrix `y[0]`, `y[1]`; pickled objects are never opened, and left out",
    lambda head: head.startswith(b"PK\x03\x04") and b".npy" in head[30:300],
    read_npz_table,
)
ONE = Form(
    "npy",
    (".npy",),
    "one array of NumPy",
    'columns of a matrix `"0"`, `"1"`, ..., or the fields of a structured array by name',
    lambda head: head.startswith(b"\x93NUMPY"),
    read_npy_table,
)
