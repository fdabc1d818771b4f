"""Whether the heaps of an HDF5 file, in which texts of any length lie, have a valid structure.

The library trusts the sizes in a heap: one of zero keeps it busy for ever instead of raising an error. So they are
checked first. Source: The HDF Group, *HDF5 File Format Specification*, "Level 1E - Global Heap".
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

_SIGNATURE = b"GCOL\x01\0\0\0"
_HEAD, _ENTRY = 16, 16


def heap_damage(path: Path) -> str:
    """Return what is wrong with the heaps of a file; empty when they are valid.

    `path`: with offsets and lengths of eight bytes, as all files of today.
    """
    with path.open("rb") as stream:
        if not path.stat().st_size:
            return ""
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            place = data.find(_SIGNATURE)
            while place >= 0:
                if not _is_whole(data, place):
                    return f"the heap of texts at byte {place} is damaged"
                place = data.find(_SIGNATURE, place + len(_SIGNATURE))
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
