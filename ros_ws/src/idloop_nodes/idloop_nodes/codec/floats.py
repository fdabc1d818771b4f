"""std_msgs/Float64 and std_msgs/Float64MultiArray: bytes to numbers and back."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from idloop.records.bags.cdr import HEADER, CdrReader

_FLOAT = struct.Struct("<d")
_EMPTY_LAYOUT = bytes(8)  # no dimensions, data offset 0


def encode_float(value: float) -> bytes:
    """Return std_msgs/Float64 as bytes."""
    return HEADER + _FLOAT.pack(value)


def decode_float(data: bytes) -> float:
    """Return the number of a std_msgs/Float64; CdrError when there is none."""
    return float(_FLOAT.unpack(CdrReader(data).take(8))[0])


def encode_floats(values: Sequence[float]) -> bytes:
    """Return std_msgs/Float64MultiArray without dimensions, as controllers of ros2_control take it."""
    padding = bytes(4) if values else b""
    return HEADER + _EMPTY_LAYOUT + struct.pack("<I", len(values)) + padding + struct.pack(f"<{len(values)}d", *values)


def decode_floats(data: bytes) -> tuple[float, ...]:
    """Return the numbers of a std_msgs/Float64MultiArray, whatever its dimensions are.

    Raises CdrError: when the bytes are cut short or no Float64MultiArray.
    """
    reader = CdrReader(data)
    for _ in range(reader.count()):  # dimensions
        reader.string()
        reader.uint32()
        reader.uint32()
    reader.uint32()
    return reader.doubles()
