"""MATLAB files of version 7.3, which are HDF5 files with conventions of MATLAB's.

Arrays lie transposed, texts as numbers of their characters, cells and structure arrays as references to data sets.
Source: the attributes ``MATLAB_class`` and ``MATLAB_empty`` that MATLAB R2006b and later write.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from idloop.documents import MOST_DEPTH
from idloop.errors import InputError
from idloop.records.formats.hdf5 import Hdf5Reader, opened
from idloop.records.formats.mat_objects import Objects, Reference

_NUMBERS = {"double", "single", "logical"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
# Entries of cells and structure arrays; a longer one is no log.
_MOST_ENTRIES = 100_000


def read_mat_hdf5(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the variables of a file as nested arrays, and the names of those that are objects which are not read."""
    with opened(path) as file:
        reader = _Reader(path, file)
        tree = {
            name: reader.value(item, name, 0) for name, item in reader.data.entries(file) if not name.startswith("#")
        }
        objects = Objects(reader.subsystem() if reader.has_objects else [])
        tree = {name: objects.resolved(value, name) for name, value in tree.items()}
    return {name: value for name, value in tree.items() if value is not None}, objects.unread


class _Reader:
    """Turns data sets into what `scipy.io.loadmat` makes of those of older versions."""

    def __init__(self, path: Path, file: Any) -> None:
        self.data = Hdf5Reader(path)
        self.has_objects = False
        self._path, self._file, self._followed = path, file, 0

    def value(self, item: Any, name: str, depth: int) -> Any:
        if depth > MOST_DEPTH:
            raise InputError(f"{self._path}: structures more than {MOST_DEPTH} deep; check that this is the file")
        kind = item.attrs.get("MATLAB_class", b"")
        kind = kind.decode("utf-8", "replace") if isinstance(kind, bytes) else str(kind)
        if "MATLAB_object_decode" in item.attrs and kind != "FileWrapper__":
            self.has_objects = True
            numbers = self.data.values(item) if getattr(item, "dtype", np.dtype("O")).kind in "iu" else None
            return Reference(
                np.asarray(numbers, dtype=np.int64).ravel() if numbers is not None else np.zeros(0, np.int64)
            )
        if not hasattr(item, "shape"):
            return self._structure(item, name, depth) if hasattr(item, "keys") else None
        if "MATLAB_empty" in item.attrs:
            return "" if kind == "char" else None
        if item.dtype.hasobject:
            entries = self._referred(item, name, depth)
            return entries[0] if kind != "cell" and len(entries) == 1 else entries
        values = self.data.values(item)
        if kind == "char":
            return "".join(map(chr, np.asarray(values).ravel().tolist())) if values is not None else None
        if values is None or (kind and kind not in _NUMBERS):
            return None
        array = np.asarray(values)
        if array.dtype.names == ("real", "imag"):
            array = array["real"] + 1j * array["imag"]
        return np.squeeze(array.T)[()]

    def subsystem(self) -> list[Any]:
        """Return the cells in which the properties of objects lie."""
        group = self._file.get("#subsystem#")
        item = group.get("MCOS") if group is not None else None
        cells = self.value(item, "MCOS", 0) if item is not None else None
        return cells if isinstance(cells, list) else []

    def _structure(self, group: Any, name: str, depth: int) -> Any:
        fields = {key: self.value(item, f"{name}.{key}", depth + 1) for key, item in self.data.entries(group)}
        arrays = [key for key, item in self.data.entries(group) if getattr(item, "dtype", None) is not None
                  and item.dtype.hasobject and "MATLAB_class" not in item.attrs]  # fmt: skip
        lengths = {len(fields[key]) for key in arrays if isinstance(fields[key], list)}
        # A structure array has one data set of references for each of its fields.
        if arrays and len(arrays) == len(fields) and len(lengths) == 1:
            (count,) = lengths
            return [{key: fields[key][place] for key in arrays} for place in range(count)]
        return self._streamed(fields) or fields

    def _streamed(self, fields: dict[str, Any]) -> dict[str, Any]:
        """Stamps and values of a signal of Simulink that lie apart, as a first stamp with a step and a row of bytes."""
        stamps, number, kind = (fields.get(key) for key in ("CompressedTime", "DataR2", "SignalAttributes"))
        if not (isinstance(stamps, np.ndarray) and stamps.shape == (3,) and isinstance(number, np.floating)):
            return {}
        item = self._file.get(f"#sigstream#/{number:.0f}/#data#")
        stream = self.data.values(item) if item is not None else None
        name = str(kind.get("ClassName")) if isinstance(kind, dict) else ""
        if not isinstance(stream, np.ndarray) or name not in _NUMBERS:
            return {}
        begin, step, count = stamps.tolist()
        values = np.frombuffer(stream.tobytes(), dtype="bool" if name == "logical" else name)
        if not 0 < count <= values.size or values.size % int(count):
            return {}
        values = np.squeeze(values.reshape(int(count), -1))
        return {"Time": begin + step * np.arange(int(count)), "Data": values}

    def _referred(self, item: Any, name: str, depth: int) -> list[Any]:
        import h5py

        references = self.data.values(item) if h5py.check_string_dtype(item.dtype) else None
        if references is not None or h5py.check_ref_dtype(item.dtype) is None:
            return []
        self._followed += item.size
        if self._followed > _MOST_ENTRIES:
            raise InputError(f"{self._path}: more than {_MOST_ENTRIES:,} entries of cells; save plain arrays")
        several = np.asarray(item[()]).T.ravel(order="F")
        return [
            self.value(self._file[one], f"{name}[{place}]", depth + 1) if one else None
            for place, one in enumerate(several)
        ]
