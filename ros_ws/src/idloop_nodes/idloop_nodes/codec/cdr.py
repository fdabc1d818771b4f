"""Little-endian CDR (XCDR version 1), written with zeroed padding.

The serializer behind rclpy leaves whatever was in memory in the padding, so that two equal messages
differ as bytes. Recordings that must be identical, run after run, need bytes that are defined.
"""

from __future__ import annotations

import struct

HEADER = b"\x00\x01\x00\x00"  # encapsulation: plain CDR, little endian


class CdrError(ValueError):
    """The bytes are no little-endian CDR message of the expected type."""


class CdrWriter:
    """Builds one message; alignment counts from behind the four encapsulation bytes."""

    def __init__(self) -> None:
        self.data = bytearray(HEADER)

    def align(self, size: int) -> None:
        """Pad with zeros to a multiple of `size` bytes."""
        self.data.extend(bytes(-(len(self.data) - 4) % size))

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

    def finish(self) -> bytes:
        """Return the message, padded to a multiple of four bytes."""
        self.align(4)
        return bytes(self.data)


class CdrReader:
    """Takes one message apart; every read checks that the bytes are there."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[1] != 1:
            raise CdrError("not a little-endian CDR message")
        self.data = data
        self.at = 4

    def align(self, size: int) -> None:
        """Step over padding to a multiple of `size` bytes."""
        self.at += -(self.at - 4) % size

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
        return int(struct.unpack("<i", self.take(4))[0])

    def uint32(self) -> int:
        """Read an unsigned 32-bit integer."""
        self.align(4)
        return int(struct.unpack("<I", self.take(4))[0])

    def uint8(self) -> int:
        """Read one byte."""
        return self.take(1)[0]

    def string(self) -> str:
        """Read a string."""
        size = self.uint32()
        raw = self.take(size)
        return raw[:-1].decode(errors="replace") if size else ""
