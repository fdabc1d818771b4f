"""MATLAB files: arrays, structures, and the objects timeseries, timetable and table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options
from idloop.records.formats.hdf5 import HDF5_SIGNATURE
from idloop.records.formats.isolated import read_isolated
from idloop.records.formats.mat_hdf5 import read_mat_hdf5
from idloop.records.formats.tree import table_of_tree
from idloop.records.tables.mat_structure import mat_damage
from idloop.records.tables.table import Table


def read_mat(path: Path, _: Options) -> Table:
    """Read the series of a MAT file.

    Raises
    ------
    InputError
        Damaged, too large, or with objects alone that only MATLAB reads.
    """
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; save fewer variables in it")
    with path.open("rb") as stream:
        head = stream.read(1024)
    if HDF5_SIGNATURE in head:
        tree, objects = read_isolated(path, "MATLAB 7.3", lambda: read_mat_hdf5(path))
    else:
        tree, objects = _load(path)
    table = table_of_tree(path, tree)
    if objects:
        text = (
            f"{objects[0]!r} is a MATLAB object (timeseries, timetable, table), which only MATLAB reads; save its Time"
            " and Data as plain arrays"
        )
        if not table.columns:
            raise InputError(f"{path}: {text}")
        table.notes.append(text)
    return table


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Variables of a file up to version 7, and the names of those that are objects."""
    from scipy.io import loadmat

    try:
        damage = mat_damage(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if damage:
        raise InputError(f"{path}: not a readable MAT file ({damage}); check the copy of the file")
    try:
        content = loadmat(path, simplify_cells=True)
    except Exception as error:  # noqa: BLE001 - any parsing error means a damaged file
        raise InputError(
            f"{path}: not a readable MAT file ({type(error).__name__}); check the copy of the file"
        ) from None
    tree = {name: value for name, value in content.items() if not name.startswith("__")}
    return tree, [name for name, value in content.items() if type(value).__name__ == "MatlabOpaque"]


FORM = Form(
    "mat",
    (".mat",),
    "MATLAB, versions 4 to 7.3",
    "arrays; those in structures are `log.u`, in structure arrays `log[0].u` (counted from 0), the columns of a matrix"
    " `log.y[0]`, `log.y[1]`; signals of Simulink by their labels, with the `time` of their structure",
    lambda head: head.startswith(b"MATLAB "),
    read_mat,
)
