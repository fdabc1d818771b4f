"""HDF5 files: data sets by path, the fields of compound ones, the tables of pandas."""

from __future__ import annotations

import io
import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.documents import MOST_COLUMNS, MOST_DEPTH, MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, needs, not_readable
from idloop.records.formats.isolated import read_isolated
from idloop.records.formats.pickled import read_pickle
from idloop.records.formats.tree import table_of_tree
from idloop.records.tables.base_units import is_unit_key
from idloop.records.tables.table import Table

if TYPE_CHECKING:
    import h5py

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEAP, _HEAD, _ENTRY = b"GCOL\x01\0\0\0", 16, 16  # signature of a heap, bytes of its head and of that of an entry
# Bytes of one text of a series of texts.
_TEXT = 64


def is_hdf5(head: bytes) -> bool:
    """Whether a file begins as HDF5, with or without a block of the user's in front."""
    return any(head[place : place + 8] == HDF5_SIGNATURE for place in (0, 512, 1024, 2048, 4096))


def heap_damage(path: Path) -> str:
    """Return what is wrong with the heaps of a file, in which texts of any length lie; empty when they are valid.

    The library trusts their sizes: one of zero keeps it busy for ever instead of raising an error. Source: The HDF
    Group, *HDF5 File Format Specification*, "Level 1E - Global Heap", with lengths of eight bytes.
    """
    with path.open("rb") as stream:
        if not path.stat().st_size:
            return ""
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            place = data.find(_HEAP)
            while place >= 0:
                if not _is_whole(data, place):
                    return f"the heap of texts at byte {place} is damaged"
                place = data.find(_HEAP, place + len(_HEAP))
    return ""


def _is_whole(data: mmap.mmap, place: int) -> bool:
    """Whether the entries of a heap fill it."""
    if place + _HEAD > len(data):
        return True  # a text of these letters at the end
    (size,) = struct.unpack_from("<Q", data, place + 8)
    end = place + size
    if size < _HEAD or end > len(data):
        return False
    place += _HEAD
    while place + _ENTRY <= end:
        index, _, _, length = struct.unpack_from("<HHIQ", data, place)
        if index == 0:
            # What is free, with its own head.
            return bool(length == end - place)
        place += _ENTRY + -(-length // 8) * 8
    return bool(place <= end)


def opened(path: Path) -> h5py.File:
    """Open a file whose heaps are valid."""
    try:
        import h5py
    except ImportError:
        raise needs(path, "h5py") from None
    if damage := heap_damage(path):
        raise not_readable(path, "HDF5", damage)
    return h5py.File(path, "r")


class Hdf5Reader:
    """Reads data sets as long as they take no more than a table may."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._bytes = self._count = 0

    def entries(self, group: h5py.Group) -> Iterator[tuple[str, Any]]:
        """Yield the groups and data sets that lie in this file, by name; links elsewhere are not followed."""
        import h5py

        for name in group:
            if isinstance(group.get(name, getlink=True), h5py.HardLink):
                self._count += 1
                if self._count > 10 * MOST_COLUMNS:
                    raise InputError(f"{self._path}: more than {10 * MOST_COLUMNS:,} data sets; keep fewer")
                yield name, group[name]

    def values(self, data: h5py.Dataset) -> Any:
        """Return a data set as an array, a text or a list of texts; None for what is no data."""
        import h5py

        if data.external or data.is_virtual or data.shape is None:
            return None
        kind = data.dtype
        text = h5py.check_string_dtype(kind)
        if text is None and kind.kind in "OV" and not kind.names:
            return None
        chunk = int(np.prod(data.chunks, dtype=np.float64)) if data.chunks else 0
        size = max(data.size, chunk) * (kind.itemsize if text is None else max(kind.itemsize, _TEXT))
        self._bytes += size
        if self._bytes > MOST_TABLE:
            raise InputError(
                f"{self._path}: its data sets take more than {MOST_TABLE >> 30} GiB with {data.name}; keep fewer"
            )
        if text is not None:
            return self._texts(data)
        plain = [name for name in kind.names or () if not kind[name].hasobject]
        return data.fields(plain)[()] if kind.hasobject and plain else data[()] if not kind.hasobject else None

    def _texts(self, data: h5py.Dataset) -> Any:
        found = np.asarray(data[()], dtype=object)
        texts = [one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in found.ravel()]
        return texts[0] if found.ndim == 0 and texts else texts


def read_hdf5(path: Path, _: Options) -> Table:
    """Read the series of an HDF5 file."""
    tree, units, attributes = read_isolated(path, "HDF5", lambda: _content(path))
    table = table_of_tree(path, tree, separator="/", clocks=True)
    for name in table.columns:
        unit = units.get(name) or units.get(name.rpartition("[")[0])
        if unit:
            table.units[name] = unit
    table.attributes |= {name: value for name, value in attributes.items() if isinstance(value, float | str)}
    return table


def _content(path: Path) -> tuple[dict[str, Any], dict[str, str], dict[str, float | str | None]]:
    """Series as a tree, their units by path, and the attributes of the file."""
    units: dict[str, str] = {}
    with opened(path) as file:
        tree = _tree(Hdf5Reader(path), file, "", units, 0)
        return tree, units, {name: _attribute(file, name) for name in file.attrs}


def _tree(reader: Hdf5Reader, group: Any, place: str, units: dict[str, str], depth: int) -> dict[str, Any]:
    if depth > MOST_DEPTH:
        raise InputError(f"{group.file.filename}: groups more than {MOST_DEPTH} deep; check that this is the file")
    found: dict[str, Any] = {}
    for name, item in reader.entries(group):
        full = f"{place}{name}"
        if not hasattr(item, "shape"):
            if hasattr(item, "keys"):
                own = {key: value for key in item.attrs if isinstance(value := _attribute(item, key), float)}
                found[name] = own | _of_pandas(_tree(reader, item, full + "/", units, depth + 1))
            continue
        value = reader.values(item)
        if value is None:
            continue
        said = (_attribute(item, attribute) for attribute in item.attrs if is_unit_key(attribute))
        if unit := next((one for one in said if isinstance(one, str) and one), ""):
            units[full] = unit
        if isinstance(value, np.ndarray) and value.dtype.names:
            found[name] = _fields(item, value)
        else:
            found[name] = value
    return found


def _attribute(item: Any, name: str) -> float | str | None:
    """Return an attribute that is a number or a text."""
    kept = item.attrs.get_id(name)
    if kept.get_storage_size() > 1 << 16:
        return None
    value = item.attrs[name]
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    if array.size == 1 and array.dtype.kind in "biuf":
        return float(array.ravel()[0])
    return None


def _fields(item: Any, value: Any) -> dict[str, Any]:
    """Fields of a compound data set; those that pandas packs together by the names that it keeps beside them."""
    found: dict[str, Any] = {}
    for field in value.dtype.names:
        series = value[field]
        names = _packed_names(item, field)
        if series.ndim == 2 and len(names) == series.shape[1]:
            found |= {name: series[:, place] for place, name in enumerate(names)}
        else:
            found[field] = series
    return found


def _packed_names(item: Any, field: str) -> list[str]:
    """Names of the columns in a block of pandas, which it keeps as a pickled list of texts."""
    name = f"{field}_kind"
    if not field.startswith("values_block_") or name not in item.attrs:
        return []
    kept = item.attrs[name]
    data = kept if isinstance(kept, bytes) else bytes(kept) if isinstance(kept, np.bytes_) else str(kept).encode()
    try:
        names = read_pickle(io.BytesIO(data))
    except InputError:
        return []
    return [str(one) for one in names] if isinstance(names, list | tuple) else []


def _of_pandas(tree: dict[str, Any]) -> dict[str, Any]:
    """Columns of a frame that pandas wrote in its fixed format: blocks of values with the names of their columns."""
    found: dict[str, Any] = {}
    blocks = 0
    while f"block{blocks}_items" in tree and f"block{blocks}_values" in tree:
        names, values = tree[f"block{blocks}_items"], np.asarray(tree[f"block{blocks}_values"])
        if values.ndim != 2 or not isinstance(names, list) or len(names) != values.shape[1]:
            return tree
        found |= {name: values[:, place] for place, name in enumerate(names)}
        blocks += 1
    if not blocks:
        return tree
    return {"index": tree.get("axis1", []), **found}


FORM = Form(
    "hdf5",
    (".h5", ".hdf5", ".hdf", ".he5"),
    "HDF5",
    "data sets by their path, `run/u`; the columns of a matrix `run/y[0]`, the fields of a compound data set"
    " `run/log/u`; a series called time or t holds the stamps of those of its length in its group; units"
    " from the attribute `units`",
    is_hdf5,
    read_hdf5,
)
