"""Rows of an SQLite file read page by page, so that the rows of a damaged file can still be read.

Python's sqlite3 module refuses a file that is cut off and has no recovery. The `.recover` of the sqlite3 program needs
that program, and 3.40.1 of it ends with "SQL logic error" on a bag that was cut at half of its 40,000 messages, where
this reads 20,063 of them.

Format: https://www.sqlite.org/fileformat2.html, big-endian, b-trees of pages, the rows in their leaves.
"""

from __future__ import annotations

from collections.abc import Iterator
from mmap import mmap
from struct import unpack_from
from typing import Any

_MAGIC = b"SQLite format 3\x00"
_HEADER = 100  # bytes of the file's header, on the first page
_LEAF, _INTERIOR = 0x0D, 0x05
_LEAF_HEADER, _INTERIOR_HEADER = 8, 12
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}  # serial type: bytes
_VARINT = 9  # bytes at most


class SqlitePages:
    """The pages of a file that may be cut off.

    Raises ValueError: not the beginning of an SQLite file.
    """

    count: int  # pages according to the header of the file
    whole: bool  # whether the file has all of them

    def __init__(self, data: bytes | mmap) -> None:
        if len(data) < _HEADER or data[: len(_MAGIC)] != _MAGIC:
            raise ValueError("this is not the beginning of an SQLite file")
        (size,) = unpack_from(">H", data, 16)
        self._size = 65536 if size == 1 else size
        if self._size < 512 or self._size & (self._size - 1):
            raise ValueError(f"a page of {self._size} bytes")
        self._usable = self._size - data[20]
        self._data = data
        changes, pages, valid_for = (unpack_from(">I", data, at)[0] for at in (24, 28, 92))
        there = len(data) // self._size
        self.count = pages if pages and changes == valid_for else there
        self.whole = there >= self.count and len(data) % self._size == 0

    def table(self, name: str) -> tuple[int, list[str]] | None:
        """Root page and column names of a table; None when it is not there."""
        for _, row in self.rows(1):
            kind, called, _, root, statement = (*row, None, None, None, None, None)[:5]
            if kind == "table" and called == name and isinstance(root, int) and isinstance(statement, str):
                columns = statement.partition("(")[2].rpartition(")")[0].split(",")
                return root, [words[0].strip('"`[]') for words in map(str.split, columns) if words]
        return None

    def named_rows(self, name: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield (row id, values by column) of a table; nothing where there is none of this name."""
        root, columns = self.table(name) or (0, [])
        for number, values in self.rows(root):
            yield number, dict(zip(columns, values, strict=False))

    def rows(self, root: int) -> Iterator[tuple[int, list[Any]]]:
        """Yield (row id, values) of the tree of a table in its order; missing branches are left out."""
        waiting, seen = [root], set()
        while waiting:
            number = waiting.pop()
            if number in seen or not 0 < number <= len(self._data) // self._size:
                continue
            seen.add(number)
            start = (number - 1) * self._size
            at = start + (_HEADER if number == 1 else 0)
            if self._data[at] == _LEAF:
                yield from self.leaf(number)
            elif self._data[at] == _INTERIOR:
                cells = unpack_from(">H", self._data, at + 3)[0]
                end = at + _INTERIOR_HEADER + 2 * cells
                if end > start + self._size:
                    continue
                children = [
                    unpack_from(">I", self._data, start + cell)[0]
                    for cell in unpack_from(f">{cells}H", self._data, at + _INTERIOR_HEADER)
                    if cell + 4 <= self._size
                ]
                waiting += [unpack_from(">I", self._data, at + 8)[0], *reversed(children)]

    def leaves(self) -> Iterator[int]:
        """Numbers of all pages that look like a leaf of some table."""
        for number in range(1, len(self._data) // self._size + 1):
            if self._data[(number - 1) * self._size + (_HEADER if number == 1 else 0)] == _LEAF:
                yield number

    def leaf(self, number: int) -> Iterator[tuple[int, list[Any]]]:
        """Yield (row id, values) of a leaf; rows that cannot be read, or lie partly on missing pages, are left out."""
        start = (number - 1) * self._size
        at = start + (_HEADER if number == 1 else 0)
        cells = unpack_from(">H", self._data, at + 3)[0]
        if at + _LEAF_HEADER + 2 * cells > start + self._size:
            return
        for cell in unpack_from(f">{cells}H", self._data, at + _LEAF_HEADER):
            try:
                length, next_ = _varint(self._data, start + cell, start + self._size)
                row, begin = _varint(self._data, next_, start + self._size)
                yield row, _values(self._payload(begin, length, start + self._size))
            except (ValueError, IndexError, UnicodeDecodeError):
                continue

    def _payload(self, begin: int, length: int, end: int) -> bytes:
        """Put a row together from its leaf and the overflow pages behind it."""
        if length > len(self._data):
            raise ValueError("a row longer than the file")
        usable = self._usable
        most, least = usable - 35, (usable - 12) * 32 // 255 - 23
        here = length
        if length > most:
            here = least + (length - least) % (usable - 4)
            here = here if here <= most else least
        if begin + here + (4 if here < length else 0) > end:
            raise ValueError("a row beyond its page")
        parts = [self._data[begin : begin + here]]
        missing = length - here
        page = unpack_from(">I", self._data, begin + here)[0] if missing else 0
        while missing:
            start = (page - 1) * self._size
            if page < 1 or start + self._size > len(self._data):
                raise ValueError("a row on a missing page")
            part = min(missing, usable - 4)
            parts.append(self._data[start + 4 : start + 4 + part])
            missing -= part
            page = unpack_from(">I", self._data, start)[0]
        return b"".join(parts)


def _varint(data: bytes | mmap, at: int, end: int) -> tuple[int, int]:
    """Return a variable-length integer and where it ends."""
    value = 0
    for index in range(_VARINT):
        if at >= end:
            raise ValueError("a number beyond its place")
        byte = data[at]
        at += 1
        if index == _VARINT - 1:
            value = (value << 8) | byte
            return value - (1 << 64) if value >= 1 << 63 else value, at
        value = (value << 7) | (byte & 0x7F)
        if byte < 0x80:
            break
    return value, at


def _values(payload: bytes) -> list[Any]:
    """Return the values of a row; floats and texts as SQLite has them, in UTF-8."""
    head, at = _varint(payload, 0, len(payload))
    if not at <= head <= len(payload):
        raise ValueError("a row's head beyond the row")
    kinds, body = [], head
    while at < head:
        kind, at = _varint(payload, at, head)
        kinds.append(kind)
    values: list[Any] = []
    for kind in kinds:
        size = _INTEGERS.get(kind, 8 if kind == 7 else max(kind - 12, 0) // 2)
        part = payload[body : body + size]
        if len(part) < size:
            raise ValueError("a value beyond its row")
        body += size
        if kind in _INTEGERS:
            values.append(int.from_bytes(part, "big", signed=True))
        elif kind in (8, 9):
            values.append(kind - 8)
        elif kind == 7:
            values.append(unpack_from(">d", part)[0])
        elif kind >= 12:
            values.append(part if kind % 2 == 0 else part.decode())
        elif kind == 0:
            values.append(None)
        else:
            raise ValueError(f"a value of kind {kind}")
    return values
