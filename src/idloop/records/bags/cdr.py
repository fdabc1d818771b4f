"""CDR (XCDR version 1) byte by byte: the fields of one message, and where a JointState has its numbers.

The serializer behind rclpy leaves whatever was in memory in the padding, so that two equal messages differ as bytes.
Recordings that must be identical, run after run, need padding of zeros. Nothing here needs numpy, so that a node that
reads and writes single messages starts without it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

HEADER = b"\x00\x01\x00\x00"  # encapsulation: plain CDR, little endian; alignment counts from behind it
SECOND = 1_000_000_000


class CdrError(ValueError):
    """The bytes are no CDR message of the expected type."""


class CdrWriter:
    """Builds one little-endian message."""

    def __init__(self) -> None:
        self.data = bytearray(HEADER)

    def align(self, size: int) -> None:
        """Pad with zeros to a multiple of `size` bytes."""
        self.data.extend(bytes(-(len(self.data) - len(HEADER)) % size))

    def int32(self, value: int) -> None:
        """Append a signed 32-bit integer."""
        self.align(4)
        self.data += struct.pack("<i", value)

    def uint32(self, value: int) -> None:
        """Append an unsigned 32-bit integer."""
        self.align(4)
        self.data += struct.pack("<I", value)

    def uint8(self, value: int) -> None:
        """Append one byte."""
        self.data.append(value)

    def string(self, text: str) -> None:
        """Append a string: length with the closing zero, bytes, zero."""
        encoded = text.encode()
        self.uint32(len(encoded) + 1)
        self.data += encoded + b"\x00"

    def stamp(self, stamp_ns: int) -> None:
        """Append a builtin_interfaces/Time from nanoseconds."""
        self.int32(stamp_ns // SECOND)
        self.uint32(stamp_ns % SECOND)

    def doubles(self, values: Sequence[float]) -> None:
        """Append a sequence of doubles."""
        self.uint32(len(values))
        if values:
            self.align(8)
            self.data += struct.pack(f"<{len(values)}d", *values)

    def finish(self) -> bytes:
        """Return the message, padded to a multiple of four bytes."""
        self.align(4)
        return bytes(self.data)


class CdrReader:
    """Takes one message apart; every read checks that the bytes are there.

    `data`: the message.
    `order`: one of "<", ">". Byte order that it must have: little or big endian.
    Raises CdrError: the message is not plain CDR in this byte order. The methods raise it where the bytes end too
    early.
    """

    def __init__(self, data: bytes, order: str = "<") -> None:
        if len(data) < len(HEADER) or data[1] != (order == "<"):
            raise CdrError(f"not a {'little' if order == '<' else 'big'}-endian CDR message")
        self.data = data
        self.at = len(HEADER)
        self._order = order

    def align(self, size: int) -> None:
        """Step over padding to a multiple of `size` bytes."""
        self.at += -(self.at - len(HEADER)) % size

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes."""
        piece = self.data[self.at : self.at + size]
        if len(piece) != size:
            raise CdrError(f"message ends at byte {len(self.data)}, {self.at + size} wanted")
        self.at += size
        return piece

    def int32(self) -> int:
        """Read a signed 32-bit integer."""
        self.align(4)
        return int(struct.unpack(f"{self._order}i", self.take(4))[0])

    def uint32(self) -> int:
        """Read an unsigned 32-bit integer."""
        self.align(4)
        return int(struct.unpack(f"{self._order}I", self.take(4))[0])

    def uint8(self) -> int:
        """Read one byte."""
        return self.take(1)[0]

    def count(self, item_size: int = 1) -> int:
        """Read the length of a sequence; refuse one that the message cannot hold."""
        size = self.uint32()
        if size * item_size > len(self.data):
            raise CdrError(f"a sequence of {size} items cannot be in {len(self.data)} bytes")
        return size

    def string(self) -> str:
        """Read a string; bytes that are no UTF-8 are replaced."""
        return self.take(self.count())[:-1].decode(errors="replace")

    def stamp(self) -> int:
        """Read a builtin_interfaces/Time as nanoseconds."""
        seconds = self.int32()
        return seconds * SECOND + self.uint32()

    def doubles(self) -> tuple[float, ...]:
        """Read a sequence of doubles."""
        size = self.count(8)
        if size:
            self.align(8)
        return struct.unpack(f"{self._order}{size}d", self.take(8 * size))


@dataclass(frozen=True)
class JointLayout:
    """Where the parts of a sensor_msgs/JointState lie; the same while joint names and lengths stay the same."""

    order: str  # ``"<"`` or ``">"``
    names: tuple[str, ...]  # joint names; bytes that are no UTF-8 are replaced
    # First byte and number of doubles of position, velocity and effort
    offsets: tuple[int, int, int]
    counts: tuple[int, int, int]
    # Stretches of bytes, from start to stop, that two messages of one layout have in common: all but the stamp, the
    # text of the frame, padding and numbers
    fixed: tuple[tuple[int, int], ...]
    end: int  # bytes up to the end of the last number


def read_layout(data: bytes) -> JointLayout:
    """Return the layout of one serialised JointState.

    Raises CdrError: the message is not plain CDR, or its lengths do not fit into it.
    """
    if data[:1] != b"\x00":
        raise CdrError("not plain CDR")
    order = ">" if data[1:2] == b"\x00" else "<"
    reader = CdrReader(data, order)
    reader.take(8)  # stamp
    fixed = [(0, 2)]

    def count(item_size: int) -> int:
        size = reader.count(item_size)
        fixed.append((reader.at - 4, reader.at))
        return size

    reader.take(count(1))  # frame
    names = []
    for _ in range(count(5)):
        names.append(reader.take(count(1))[:-1].decode(errors="replace"))
        fixed[-1] = (fixed[-1][0], reader.at)
    offsets, counts = [], []
    for _ in range(3):
        counts.append(count(8))
        if counts[-1]:
            reader.align(8)
        offsets.append(reader.at)
        reader.take(8 * counts[-1])
    return JointLayout(
        order=order,
        names=tuple(names),
        offsets=(offsets[0], offsets[1], offsets[2]),
        counts=(counts[0], counts[1], counts[2]),
        fixed=tuple(fixed),
        end=reader.at,
    )
