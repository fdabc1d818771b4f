"""Whether a MAT file of version 5 to 7 has a valid structure.

The compiled reader of scipy trusts the tags in the file: one that names no type ends the process instead of raising an
error. So the tags are checked first.

Format: MathWorks, *MAT-File Format*, chapter "Version 5 MAT-File Format".
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from idloop.documents import MOST_TABLE
from idloop.errors import InputError

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
_TEXT = frozenset({16, 17, 18})
_CELL, _STRUCT, _OBJECT, _CHARS, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800
# Bytes of a number of each kind but those of one byte.
_WIDTHS = {3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 17: 2, 18: 4}
_DEEPEST = 100
# Variables, with those within structures and cells: an empty one has eight bytes in the file and 200 in memory.
_MOST_VARIABLES = 1_000_000


class _DamagedError(Exception):
    """The file does not follow the format."""


class _Element(NamedTuple):
    kind: int
    content: memoryview


def mat_damage(data: bytes) -> str:
    """Return what is wrong with the tags of a MAT file; empty when they are valid.

    Parameters
    ----------
    data : bytes
        The whole file. Version 4 and 7.3 have no such tags and are not checked.

    Raises
    ------
    InputError
        Its values take more than `MOST_TABLE` in memory.
    """
    if len(data) < _HEADER:
        return "" if 0 in data[:4] else "it ends within its header"
    order = "<" if data[126:128] == b"IM" else ">"
    if 0 in data[:4] or data[124 + (order == "<")] != 1:
        return ""
    file = _File(order)
    try:
        for one in _elements(memoryview(data)[_HEADER:], order):
            if one.kind == _COMPRESSED:
                for inner in _elements(memoryview(file.unpacked(one.content)), order):
                    file.check(inner)
            else:
                file.check(one)
    except _DamagedError as error:
        return str(error)
    except zlib.error as error:
        return f"compressed data damaged: {error}"
    return ""


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """Split a stretch of the file into its elements."""
    place = 0
    while place < len(data):
        if len(data) - place < 8:
            raise _DamagedError("a tag is cut off")
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:  # up to four bytes lie within the tag
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise _DamagedError(f"a short element of {size} bytes")
            yield _Element(kind, data[place + 4 : place + 4 + size])
            place += 8
            continue
        place += 8
        if size > len(data) - place:
            raise _DamagedError(f"an element of {size} bytes where {len(data) - place} are left")
        yield _Element(kind, data[place : place + size])
        place += size if kind in (_MATRIX, _COMPRESSED) else -(-size // 8) * 8


class _File:
    """Sums over the part of a file that was checked: unpacked bytes, bytes of values, variables."""

    def __init__(self, order: str) -> None:
        self._order = order
        self._unpacked = self._values = self._variables = 0

    def unpacked(self, content: memoryview) -> bytes:
        """Unpack a compressed element; InputError where it takes too much memory."""
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(content, MOST_TABLE - self._unpacked + 1)
        self._unpacked += len(data)
        if self._unpacked > MOST_TABLE:
            raise _too_large()
        if not unpacking.eof:
            raise _DamagedError("compressed data cut off")
        return data

    def check(self, matrix: _Element, depth: int = 0) -> None:
        """Raise when a variable does not have the structure of its class, or takes too much memory."""
        if matrix.kind != _MATRIX:
            raise _DamagedError(f"type {matrix.kind} where a variable is due")
        if depth > _DEEPEST:
            raise _DamagedError(f"variables within variables, more than {_DEEPEST} deep")
        self._variables += 1
        if self._variables > _MOST_VARIABLES:
            raise InputError(f"more than {_MOST_VARIABLES:,} variables, with those in structures; save fewer")
        if not matrix.content and depth:
            return
        parts = list(_elements(matrix.content, self._order))
        strange = next((one.kind for one in parts if one.kind not in _NUMBERS | _TEXT | {_MATRIX}), None)
        if strange is not None:
            raise _DamagedError(f"unknown type {strange}")
        if not parts or len(parts[0].content) != 8:
            raise _DamagedError("a variable without its flags")
        flags = struct.unpack(f"{self._order}II", parts[0].content)[0]
        kind, values = flags & 0xFF, parts[3:]
        if kind in _NUMERIC or kind in (_CHARS, _SPARSE):
            least = 3 if kind == _SPARSE else 1
            allowed = _NUMBERS | _TEXT if kind == _CHARS else _NUMBERS
            if len(values) < least + bool(flags & _COMPLEX and kind != _CHARS):
                raise _DamagedError("a variable without its values")
            if any(one.kind not in allowed for one in values):
                raise _DamagedError("values of another type than their variable")
            # A number may be stored in one byte and takes eight.
            self._values += sum(8 * len(one.content) // _WIDTHS.get(one.kind, 1) for one in values)
            if self._values > MOST_TABLE:
                raise _too_large()
            return
        inner = [one for one in values if one.kind == _MATRIX]
        if kind in (_CELL, _STRUCT, _OBJECT) and len(inner) != _due(kind, parts, self._order):
            raise _DamagedError(f"{len(inner)} variables within one that has another number")
        for one in inner:
            self.check(one, depth + 1)


def _too_large() -> InputError:
    return InputError(f"its values take more than {MOST_TABLE >> 30} GiB; save fewer of them")


def _due(kind: int, parts: list[_Element], order: str) -> int:
    """Number of variables within a cell array, a structure or an object."""
    if len(parts) < 2 or len(parts[1].content) % 4:
        raise _DamagedError("a variable without its size")
    count = math.prod(struct.unpack(f"{order}{len(parts[1].content) // 4}i", parts[1].content))
    if kind == _CELL:
        return int(count)
    first = 3 if kind == _STRUCT else 4  # an object's class comes first
    if len(parts) < first + 2 or len(parts[first].content) != 4:
        raise _DamagedError("a structure without its names")
    (length,) = struct.unpack(f"{order}i", parts[first].content)
    if length < 1:
        raise _DamagedError(f"names of {length} bytes")
    return int(count * (len(parts[first + 1].content) // length))
