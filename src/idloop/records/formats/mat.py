"""MATLAB files: arrays, structures, and the objects timeseries, timetable, table and iddata."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import MOST_DEPTH
from idloop.errors import InputError
from idloop.records.formats.control_desk import series_of_capture
from idloop.records.formats.form import Form, Options, check_size
from idloop.records.formats.hdf5 import HDF5_SIGNATURE
from idloop.records.formats.isolated import read_isolated
from idloop.records.formats.mat_hdf5 import read_mat_hdf5
from idloop.records.formats.mat_objects import Objects, Reference, listed_cells
from idloop.records.formats.tree import runs_in, table_of_runs, table_of_tree
from idloop.records.tables.table import Table

# Bytes of the header of a file before its version.
_SUBSYSTEM = 124
_FIELDS = {"InputData", "OutputData", "InputName", "OutputName", "Ts", "SamplingInstants"}
_PAUSE = 10.0  # periods between experiments


def read_mat(path: Path, _: Options) -> Table:
    """Read the series of a MAT file."""
    check_size(path, "save fewer variables in it")
    with path.open("rb") as stream:
        head = stream.read(1024)
    if HDF5_SIGNATURE in head:
        tree, objects = read_isolated(path, "MATLAB 7.3", lambda: read_mat_hdf5(path))
    else:
        tree, objects = read_isolated(path, "MAT", lambda: _load(path))
    tree = {name: series_of_capture(value) or value for name, value in tree.items()}
    found = {name: series for name, value in tree.items() if (series := series_of_iddata(value)) is not None}
    sets = [columns for columns, _ in found.values()]
    # Sets of data with the same channels, such as those to identify and to validate with, are runs of one machine.
    alike = len(sets) > 1 and all(one.keys() == sets[0].keys() for one in sets)
    runs = runs_in({"": sets} if alike else {} if sets else tree)
    if runs is not None:
        table = table_of_runs(path, *runs)
        table.units |= runs[0][0].get("VariableUnits", {})
    else:
        table = table_of_tree(path, {**tree, **{name: columns for name, (columns, _) in found.items()}})
    # Windows of several experiments hold for the stamps of one set of data.
    table.parts = next(iter(found.values()))[1] if len(found) == 1 else {}
    if objects:
        text = f"{objects[0]!r} is an object that only MATLAB reads; save what it holds as plain arrays"
        if not table.columns:
            raise InputError(f"{path}: {text}")
        table.notes.append(text)
    return table


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Variables of a file up to version 7, and the names of those that are objects."""
    from scipy.io import loadmat

    data = path.read_bytes()
    with warnings.catch_warnings():
        # Objects have no names where the names of variables are.
        warnings.simplefilter("ignore")
        content = loadmat(io.BytesIO(data), simplify_cells=True)
        if any(type(value).__name__ == "MatlabOpaque" for value in content.values()):
            return _with_objects(data)
    return {name: value for name, value in content.items() if not name.startswith("__")}, []


def _with_objects(data: bytes) -> tuple[dict[str, Any], list[str]]:
    """Variables of a file in which some are objects, and the names of those that are not read."""
    variables, subsystem = _variables(data)
    cells: list[Any] = []
    if subsystem:
        cells = _subsystem_cells(b"MATLAB 5.0 MAT-file".ljust(_SUBSYSTEM) + subsystem[:4] + subsystem[8:])
    objects = Objects(cells)
    tree = {name: objects.resolved(value, name) for name, value in variables.items()}
    return {name: value for name, value in tree.items() if value is not None}, objects.unread


def _variables(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Variables one by one, since objects are all read under one name; and the subsystem."""
    from scipy.io import loadmat
    from scipy.io.matlab import varmats_from_mat

    found: dict[str, Any] = {}
    subsystem = b""
    for _, stream in varmats_from_mat(io.BytesIO(data)):
        for name, value in loadmat(stream, simplify_cells=True).items():
            if name == "__function_workspace__":
                subsystem = subsystem or np.asarray(value).tobytes()
            elif type(value).__name__ == "MatlabOpaque":
                found[value["s0"][0].decode("utf-8", "replace")] = _plain(value, 0)
            elif not name.startswith("__"):
                found[name] = _plain(value, 0)
    return found, subsystem


def _subsystem_cells(data: bytes) -> list[Any]:
    """Cells of the subsystem, which is a file of its own."""
    from scipy.io import loadmat
    from scipy.io.matlab import varmats_from_mat

    _, stream = varmats_from_mat(io.BytesIO(data))[0]
    content = loadmat(stream, simplify_cells=True)["__function_workspace__"]
    wrapper: Any = getattr(np.asarray(content).ravel()[0], "MCOS", None)
    if type(wrapper).__name__ != "MatlabOpaque":
        return []
    return [_plain(one, 0) for one in np.asarray(wrapper["arr"].ravel()[0]).ravel()]


def _plain(value: Any, depth: int) -> Any:
    """Return what scipy reads as mappings, lists, texts and arrays, with a reference for each object."""
    if depth > MOST_DEPTH:
        return None
    if type(value).__name__ == "MatlabOpaque":
        numbers = np.asarray(value["arr"].ravel()[0])
        return Reference(numbers.ravel().astype(np.int64)) if numbers.dtype.kind in "iu" else None
    if hasattr(value, "_fieldnames"):
        return {name: _plain(getattr(value, name), depth + 1) for name in value._fieldnames}  # noqa: SLF001 - scipy documents it
    if isinstance(value, dict):
        return {name: _plain(one, depth + 1) for name, one in value.items()}
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        entries = [_plain(one, depth + 1) for one in value.ravel()]
        return entries[0] if len(entries) == 1 else entries
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return str(value.ravel()[0]) if value.size == 1 else list(map(str, value.ravel()))
    return np.squeeze(value) if isinstance(value, np.ndarray) else value


Parts = dict[str, tuple[float, float]]


def series_of_iddata(value: Any) -> tuple[dict[str, Any], Parts] | None:
    """Return stamps and channels of identification data, and the times of its experiments; None for others."""
    if not isinstance(value, Mapping) or not value.keys() >= _FIELDS:
        return None
    inputs, outputs = _experiments(value["InputData"]), _experiments(value["OutputData"])
    count = len(outputs)
    if not count or len(inputs) != count or any(len(u) != len(y) for u, y in zip(inputs, outputs, strict=True)):
        return None
    periods, starts = _of_each(value["Ts"], count), _of_each(value.get("Tstart"), count)
    instants = _experiments(value["SamplingInstants"])
    times, end = [], 0.0
    for k, output in enumerate(outputs):
        time = _times(instants[k] if len(instants) == count else None, periods[k], starts[k], len(output))
        if time is None:
            return None
        if k and time[0] <= end:
            time = time - time[0] + end + _PAUSE * float(np.median(np.diff(time)))
        times.append(time)
        end = float(time[-1])
    # What is empty is no text, but an array without entries.
    unit = next(iter(_texts(value.get("TimeUnit"), 1)), "")
    columns: dict[str, Any] = {"Time": np.concatenate(times)}
    units = {"Time": unit or "s"}
    for data, kind, letter in ((inputs, "Input", "u"), (outputs, "Output", "y")):
        whole = np.concatenate(data)
        names = _texts(value[f"{kind}Name"], whole.shape[1]) or [f"{letter}{k + 1}" for k in range(whole.shape[1])]
        columns |= {name: whole[:, k] for k, name in enumerate(names)}
        said = _texts(value.get(f"{kind}Unit"), whole.shape[1])
        units |= {name: unit for name, unit in zip(names, said, strict=False) if unit}
    if len(columns) != 1 + inputs[0].shape[1] + outputs[0].shape[1]:
        return None
    named = _texts(value.get("ExperimentName"), count) or [f"experiment {k + 1}" for k in range(count)]
    edges = [*(float(time[0]) for time in times), np.inf]
    parts = dict(zip(named, pairwise(edges), strict=True)) if count > 1 else {}
    return columns | {"VariableUnits": units}, parts


def _experiments(value: Any) -> list[Array]:
    """Samples by channels, of each experiment."""
    several = [value] if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" else listed_cells(value)
    found = [np.asarray(one, dtype=np.float64) for one in several if np.asarray(one).dtype.kind in "biuf"]
    return [one[:, None] if one.ndim == 1 else one for one in found if 0 < one.ndim < 3]


def _of_each(value: Any, count: int) -> list[float]:
    """Return a number of each experiment; NaN where it is not said."""
    cells = [value] if isinstance(value, int | float) else listed_cells(value)
    numbers = [float(np.asarray(one).ravel()[0]) if np.size(one) else np.nan for one in cells]
    return numbers if len(numbers) == count else numbers[:1] * count if len(numbers) == 1 else [np.nan] * count


def _times(instants: Array | None, period: float, start: float, count: int) -> Array | None:
    if instants is not None and instants.size == count > 1:
        return np.asarray(instants.ravel(), dtype=np.float64)
    if not (np.isfinite(period) and period > 0.0 and count > 1):
        return None
    return np.asarray((start if np.isfinite(start) else 0.0) + period * np.arange(count), dtype=np.float64)


def _texts(value: Any, count: int) -> list[str]:
    """Return a text of each channel; nothing where there are not as many."""
    cells = [value] if isinstance(value, str) else listed_cells(value)
    texts = [one if isinstance(one, str) else "" for one in cells]
    return texts if len(texts) == count else []


FORM = Form(
    "mat",
    (".mat",),
    "MATLAB, versions 4 to 7.3",
    "arrays; those in structures are `log.u`, in structure arrays `log[0].u` (counted from 0), the columns of a matrix"
    " `log.y[0]`, `log.y[1]`, or what as many texts beside it say; signals of Simulink by their labels or blocks, with"
    " the `time` of their structure; of a capture of ControlDesk the signals by their blocks; of the objects"
    " `timetable`, `table`, `timeseries`, `Dataset` and `iddata` their columns; the elements of a structure array that"
    " are runs, and several `iddata`, one after the other as `u`",
    lambda head: head.startswith(b"MATLAB "),
    read_mat,
)
