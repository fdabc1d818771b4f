"""Files of `torch.save`: tensors of numbers in dictionaries and lists, read without torch and without running a pickle.

A file of version 1.6 or later is an archive with a pickle, ``data.pkl``, and one entry of bytes for each storage; an
older one is a series of pickles with the storages behind them. Source: PyTorch, *Serialization semantics*, and
what ``torch.save`` writes.
"""

from __future__ import annotations

import io
import math
import struct
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from idloop.documents import MOST_DEPTH, MOST_TABLE, MOST_VALUES
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, reason_of
from idloop.records.formats.isolated import read_isolated
from idloop.records.formats.json_file import table_of_content
from idloop.records.formats.pickled import read_pickle
from idloop.records.tables.table import Table

_TYPES = {
    "DoubleStorage": "<f8", "FloatStorage": "<f4", "HalfStorage": "<f2", "LongStorage": "<i8", "IntStorage": "<i4",
    "ShortStorage": "<i2", "CharStorage": "<i1", "ByteStorage": "<u1", "BoolStorage": "<?", "BFloat16Storage": "<u2",
}  # fmt: skip
_ZIP = b"PK\x03\x04"
_LEGACY = 0x1950A86A20F9469CFC6C
_LEGACY_HEAD = b"\x8a\x0a" + _LEGACY.to_bytes(10, "little")
_MOST_PICKLE = 64 << 20
_OTHER_ORDER = "it was written on a machine with the other order of bytes"


class _Storage(NamedTuple):
    """Bytes of one or more tensors."""

    key: str
    type: str


class _Tensor(NamedTuple):
    """A view into a storage: element (i, j, ...) is at offset + i * stride[0] + j * stride[1] + ..."""

    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    stride: tuple[int, ...]


_Bytes = Callable[[_Storage], bytes]  # of a storage


def read_torch(path: Path, options: Options) -> Table:
    """Read the tensors of a file as columns; the option ``entries`` is the key that holds them."""

    def read() -> Any:
        try:
            with path.open("rb") as stream:
                zipped = stream.read(len(_ZIP)) == _ZIP
                stream.seek(0)
                content, storages = _from_archive(stream) if zipped else _from_pickles(stream, path.stat().st_size)
                return _Arrays(storages).resolved(content, 0)
        except Exception as error:  # noqa: BLE001 - the libraries let those of zip, zlib and Python through
            text = str(error) if isinstance(error, InputError) else f"it is damaged ({reason_of(error, 80)})"
            raise InputError(
                f"{path}: {text}; save tensors with torch.save({{'t': t, 'u': u}}, file), or check the copy of the file"
            ) from None

    return table_of_content(path, read_isolated(path, "PyTorch", read), options)


def _rebuilt(storage: Any, offset: Any, shape: Any, stride: Any, *_: Any) -> _Tensor:
    whole = all(isinstance(one, int) for one in (offset, *shape, *stride)) and len(shape) == len(stride)
    if not isinstance(storage, _Storage) or not whole:
        raise InputError("it is damaged (a tensor of an unknown form)")
    return _Tensor(storage, offset, tuple(shape), tuple(stride))


_NAMES: dict[str, Any] = {f"torch.{name}": name for name in _TYPES} | {
    "collections.OrderedDict": OrderedDict,
    "torch.Size": tuple,
    "torch._utils._rebuild_tensor": _rebuilt,
    "torch._utils._rebuild_tensor_v2": _rebuilt,
    "torch._utils._rebuild_parameter": lambda tensor, *_: tensor,
}


def _storage(key: Any) -> _Storage:
    match key:
        case ("storage", str() as kind, str() as name, _, int(), *_) if kind in _TYPES:
            return _Storage(name, kind)
    raise InputError("it holds a storage of an unknown type")


def _from_archive(stream: BinaryIO) -> tuple[Any, _Bytes]:
    """Content of an archive, and a function that reads a storage."""
    archive = zipfile.ZipFile(stream)
    sizes = {entry.filename: entry.file_size for entry in archive.infolist()}

    def entry(name: str, most: int) -> bytes:
        # No more than its stated size is unpacked.
        if sizes.get(name, most + 1) > most:
            raise InputError(f"it has no entry {name[:60]!r} of a readable size")
        return archive.read(name)

    where = next((name for name in sizes if name.rpartition("/")[2] == "data.pkl"), "data.pkl")
    folder = where.removesuffix("data.pkl")
    if f"{folder}byteorder" in sizes and entry(f"{folder}byteorder", 64) != b"little":
        raise InputError(_OTHER_ORDER)
    content = read_pickle(io.BytesIO(entry(where, _MOST_PICKLE)), _NAMES, _storage)
    return content, lambda storage: entry(f"{folder}data/{storage.key}", MOST_TABLE)


def _from_pickles(stream: BinaryIO, size: int) -> tuple[Any, _Bytes]:
    """Content of a file from before version 1.6: pickles of a number, a version, a machine, the content, the keys."""
    if size > MOST_TABLE:
        raise InputError(f"it has more than {MOST_TABLE >> 30} GiB")
    known: dict[str, _Storage] = {}

    def stored(key: Any) -> _Storage:
        storage = _storage(key)
        return known.setdefault(storage.key, storage)

    number, _, machine, content, keys = (read_pickle(stream, _NAMES, stored) for _ in range(5))
    if number != _LEGACY or not isinstance(keys, list):
        raise InputError("it is no file of torch.save")
    if isinstance(machine, dict) and machine.get("little_endian") is False:
        raise InputError(_OTHER_ORDER)
    found: dict[str, bytes] = {}
    for key in keys:
        storage, head = known.get(key) if isinstance(key, str) else None, stream.read(8)
        if storage is None or len(head) < 8:
            raise InputError("it is cut off")
        wanted = struct.unpack("<q", head)[0] * np.dtype(_TYPES[storage.type]).itemsize
        found[key] = stream.read(wanted) if 0 <= wanted <= size else b""
        if len(found[key]) != wanted:
            raise InputError("it is cut off")
    return content, lambda storage: found.get(storage.key, b"")


class _Arrays:
    """Makes arrays of tensors."""

    def __init__(self, storages: _Bytes) -> None:
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
        raise InputError(f"it holds an object of {type(content).__name__}, which is not read")

    def _array(self, tensor: _Tensor) -> NDArray[Any]:
        storage, shape, stride = tensor.storage, tensor.shape, tensor.stride
        kind = np.dtype(_TYPES[storage.type])
        if storage not in self._read:
            data = self._storages(storage)
            self._bytes += len(data)
            self._read[storage] = np.frombuffer(data, kind, len(data) // kind.itemsize)
        flat, count = self._read[storage], math.prod(shape)
        if min(shape, default=1) < 0 or min(stride, default=0) < 0 or tensor.offset < 0:
            raise InputError("it is damaged (a tensor of a negative size)")
        self._bytes += 8 * count
        if self._bytes > MOST_TABLE:
            raise InputError(f"its tensors take more than {MOST_TABLE >> 30} GiB")
        if count == 0:
            return np.empty(0)
        if tensor.offset + sum((size - 1) * step for size, step in zip(shape, stride, strict=True)) >= flat.size:
            raise InputError("it is damaged (a tensor beyond its storage)")
        steps = [kind.itemsize * step for step in stride]
        view = np.lib.stride_tricks.as_strided(flat[tensor.offset :], shape, steps, writeable=False)
        if storage.type == "BFloat16Storage":
            return (view.astype(np.uint32) << 16).view(np.float32)
        return np.array(view)


FORM = Form(
    "torch",
    (".pt", ".pth"),
    "tensors of PyTorch",
    "tensors in a dictionary by their keys, as arrays; a file with any other object than tensors, numbers, texts, lists"
    " and dictionaries is refused: nothing in it is ever run",
    lambda head: (head.startswith(_ZIP) and b"/data.pkl" in head[:300]) or _LEGACY_HEAD in head[:16],
    read_torch,
)
