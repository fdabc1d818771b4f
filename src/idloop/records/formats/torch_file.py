"""Files of `torch.save`: tensors of numbers in dictionaries and lists, read without torch and without running a pickle.

A file of version 1.6 or later is an archive with a pickle, ``data.pkl``, and one entry of bytes for each storage; an
older one is a series of pickles with the storages behind them. Source: PyTorch, *Serialization semantics*, and
what ``torch.save`` writes.
"""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.documents import MOST_DEPTH, MOST_TABLE, MOST_VALUES
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options
from idloop.records.formats.json_file import table_of_content
from idloop.records.formats.pickle_data import Name, read_pickle, refuse
from idloop.records.tables.table import Table

_TYPES = {
    "DoubleStorage": "<f8", "FloatStorage": "<f4", "HalfStorage": "<f2", "LongStorage": "<i8", "IntStorage": "<i4",
    "ShortStorage": "<i2", "CharStorage": "<i1", "ByteStorage": "<u1", "BoolStorage": "<?", "BFloat16Storage": "<u2",
}  # fmt: skip
_REBUILD = ("_rebuild_tensor", "_rebuild_tensor_v2")
_LEGACY = 0x1950A86A20F9469CFC6C
_LEGACY_HEAD = b"\x8a\x0a" + _LEGACY.to_bytes(10, "little")
_MOST_PICKLE = 64 << 20


@dataclass(frozen=True)
class _Storage:
    """Bytes of one or more tensors."""

    key: str
    type: str
    count: int


@dataclass(frozen=True)
class _Tensor:
    """A view into a storage: element (i, j, ...) is at offset + i * stride[0] + j * stride[1] + ..."""

    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    stride: tuple[int, ...]


def read_torch(path: Path, options: Options) -> Table:
    """Read the tensors of a file as columns.

    `options`: ``entries``: key of the dictionary that holds them.
    Raises InputError: damaged, too large, or with an object that is no data, such as a whole network.
    """
    try:
        with path.open("rb") as stream:
            zipped = stream.read(4) == b"PK\x03\x04"
        content, storages = _from_archive(path) if zipped else _from_stream(path)
        arrays = _Arrays(storages)
        tree = arrays.resolved(content, 0)
    except InputError as error:
        raise InputError(
            f"{path}: {error}; save tensors with torch.save({{'t': t, 'u': u}}, file), or check the copy of the file"
        ) from None
    return table_of_content(path, tree, options)


def _call(name: Name, arguments: tuple[Any, ...]) -> Any:
    """Value of what a pickle of tensors may call."""
    function = str(name)
    if function == "collections.OrderedDict" and arguments in ((), ([],)):
        return {}
    if function == "torch.Size" and len(arguments) == 1:
        return tuple(arguments[0])
    if name.module == "torch._utils" and name.name in _REBUILD and len(arguments) >= 4:
        storage, offset, shape, stride = arguments[:4]
        whole = all(isinstance(one, int) for one in (offset, *shape, *stride)) and len(shape) == len(stride)
        if isinstance(storage, _Storage) and whole:
            return _Tensor(storage, offset, tuple(shape), tuple(stride))
    if function == "torch._utils._rebuild_parameter" and arguments and isinstance(arguments[0], _Tensor):
        return arguments[0]
    return refuse(name)


def _storage(key: Any) -> _Storage:
    if isinstance(key, tuple) and len(key) >= 5 and key[0] == "storage" and isinstance(key[1], Name):
        _, kind, name, _, count = key[:5]
        if kind.module == "torch" and kind.name in _TYPES and isinstance(name, str) and isinstance(count, int):
            return _Storage(name, kind.name, count)
    raise InputError("it holds a storage of an unknown type")


def _from_archive(path: Path) -> tuple[Any, Callable[[_Storage], bytes]]:
    """Content of an archive, and a function that reads a storage."""
    archive = _Archive(path)
    where = next((name for name in archive.names if name.rpartition("/")[2] == "data.pkl"), "data.pkl")
    folder = where.removesuffix("data.pkl")
    order = f"{folder}byteorder"
    if order in archive.names and archive.read(order, 64) != b"little":
        raise InputError("it was written on a machine with the other order of bytes")
    content = read_pickle(archive.read(where, _MOST_PICKLE), call=_call, persistent=_storage).value
    return content, lambda storage: archive.read(f"{folder}data/{storage.key}", MOST_TABLE)


class _Archive:
    """Entries of a zip archive."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with zipfile.ZipFile(path) as archive:
                self.names = {entry.filename: entry.file_size for entry in archive.infolist()}
        except Exception as error:  # noqa: BLE001 - the library lets those of zip, zlib and Python through
            raise _damaged(error) from None

    def read(self, name: str, most: int) -> bytes:
        """Return an entry of at most so many bytes; no more than its stated size is unpacked."""
        if self.names.get(name, most + 1) > most:
            raise InputError(f"it has no entry {name[:60]!r} of a readable size")
        try:
            with zipfile.ZipFile(self._path) as archive:
                return archive.read(name)
        except Exception as error:  # noqa: BLE001 - as above
            raise _damaged(error) from None


def _damaged(error: Exception) -> InputError:
    return InputError(f"it is damaged ({' '.join(str(error).split())[:80] or type(error).__name__})")


def _from_stream(path: Path) -> tuple[Any, Callable[[_Storage], bytes]]:
    """Content of a file from before version 1.6: pickles of a number, a version, a machine, the content, the keys."""
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"it has more than {MOST_TABLE >> 30} GiB")
    data = path.read_bytes()
    parts: list[Any] = []
    place = 0
    known: dict[str, _Storage] = {}

    def persistent(key: Any) -> _Storage:
        storage = _storage(key)
        return known.setdefault(storage.key, storage)

    for _ in range(5):
        one = read_pickle(data[place:] if place else data, call=_call, persistent=persistent)
        parts.append(one.value)
        place += one.end
    if parts[0] != _LEGACY or not isinstance(parts[4], list):
        raise InputError("it is no file of torch.save")
    if isinstance(parts[2], dict) and parts[2].get("little_endian") is False:
        raise InputError("it was written on a machine with the other order of bytes")
    found: dict[str, bytes] = {}
    for key in parts[4]:
        storage = known.get(key) if isinstance(key, str) else None
        if storage is None or place + 8 > len(data):
            raise InputError("it is cut off")
        (count,) = struct.unpack_from("<q", data, place)
        size = count * np.dtype(_TYPES[storage.type]).itemsize
        if count < 0 or place + 8 + size > len(data):
            raise InputError("it is cut off")
        found[key] = data[place + 8 : place + 8 + size]
        place += 8 + size
    return parts[3], lambda storage: found.get(storage.key, b"")


class _Arrays:
    """Makes arrays of tensors."""

    def __init__(self, storages: Callable[[_Storage], bytes]) -> None:
        self._storages = storages
        self._read: dict[_Storage, NDArray[Any]] = {}
        self._bytes = self._values = 0

    def resolved(self, content: Any, depth: int) -> Any:
        """Return the content with an array for each tensor."""
        self._values += 1
        if depth > MOST_DEPTH or self._values > MOST_VALUES:
            raise InputError(f"more than {MOST_VALUES:,} values beside its tensors, or more than {MOST_DEPTH} deep")
        if isinstance(content, _Tensor):
            return self._array(content)
        if isinstance(content, dict):
            return {str(name): self.resolved(value, depth + 1) for name, value in content.items()}
        if isinstance(content, list | tuple):
            return [self.resolved(value, depth + 1) for value in content]
        if content is None or isinstance(content, bool | int | float | str):
            return content
        return refuse(content if isinstance(content, Name) else type(content).__name__)

    def _array(self, tensor: _Tensor) -> NDArray[Any]:
        storage = tensor.storage
        kind = np.dtype(_TYPES[storage.type])
        if storage not in self._read:
            data = self._storages(storage)
            self._bytes += len(data)
            self._read[storage] = np.frombuffer(data, kind, len(data) // kind.itemsize)
        flat = self._read[storage]
        if min(tensor.shape, default=1) < 0 or min(tensor.stride, default=0) < 0 or tensor.offset < 0:
            raise InputError("it is damaged (a tensor of a negative size)")
        count = 1
        for size in tensor.shape:
            count *= size
        self._bytes += 8 * count
        if self._bytes > MOST_TABLE:
            raise InputError(f"its tensors take more than {MOST_TABLE >> 30} GiB")
        last = tensor.offset + sum((size - 1) * step for size, step in zip(tensor.shape, tensor.stride, strict=True))
        if count == 0:
            return np.empty(0)
        if last >= flat.size:
            raise InputError("it is damaged (a tensor beyond its storage)")
        view = np.lib.stride_tricks.as_strided(
            flat[tensor.offset :], tensor.shape, [kind.itemsize * step for step in tensor.stride], writeable=False
        )
        if storage.type == "BFloat16Storage":
            return (view.astype(np.uint32) << 16).view(np.float32)
        return np.array(view)


def _is_torch(head: bytes) -> bool:
    return (head.startswith(b"PK\x03\x04") and b"/data.pkl" in head[:300]) or _LEGACY_HEAD in head[:16]


FORM = Form(
    "torch",
    (".pt", ".pth"),
    "tensors of PyTorch",
    "tensors in a dictionary by their keys, as arrays; a file with any other object than tensors, numbers, texts, lists"
    " and dictionaries is refused: nothing in it is ever run",
    _is_torch,
    read_torch,
)
