"""sensor_msgs/JointState in CDR, many messages at once.

Consecutive messages of a topic differ in stamp and values only, so the bytes of all messages form a table
whose columns are read (or written) in one step.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]

_HEADER = 4  # encapsulation: representation identifier and options; alignment counts from behind it
_STAMP = slice(4, 12)


@dataclass(frozen=True)
class Layout:
    """Where the parts of a JointState message lie; fixed while joint names and lengths stay the same.

    Attributes
    ----------
    size : int
        Bytes per message.
    order : str
        ``"<"`` or ``">"``.
    names : tuple of str
        Joint names.
    offsets, counts : tuple of int
        First byte and number of doubles of position, velocity and effort.
    fixed : ndarray of int64
        Byte positions that must agree between messages of this layout.
    """

    size: int
    order: str
    names: tuple[str, ...]
    offsets: tuple[int, int, int]
    counts: tuple[int, int, int]
    fixed: NDArray[np.int64]


def _align(position: int, to: int) -> int:
    return position + (-(position - _HEADER)) % to


def read_layout(payload: bytes) -> Layout | None:
    """Return the layout of one serialised message, or None when it is not plain CDR or does not add up."""
    if len(payload) < 16 or payload[0] != 0 or payload[1] not in (0, 1):
        return None
    order = "<" if payload[1] else ">"
    unsigned = struct.Struct(order + "I")
    fixed: list[int] = [0, 1]

    def length_at(position: int) -> int:
        fixed.extend(range(position, position + 4))
        return int(unsigned.unpack_from(payload, position)[0])

    try:
        at = 12
        at += 4 + length_at(at)  # frame_id
        at = _align(at, 4)
        names = []
        joints = length_at(at)
        if joints > len(payload):
            return None
        at += 4
        for _ in range(joints):
            at = _align(at, 4)
            length = length_at(at)
            at += 4
            if length > len(payload) - at:
                return None
            names.append(payload[at : at + max(length - 1, 0)].decode())
            fixed.extend(range(at, at + length))
            at += length
        offsets = []
        counts = []
        for _ in range(3):
            at = _align(at, 4)
            count = length_at(at)
            at += 4
            if count:
                at = _align(at, 8)
            offsets.append(at)
            counts.append(count)
            at += 8 * count
    except (struct.error, UnicodeDecodeError):
        return None
    if not at <= len(payload) < at + 8:
        return None
    return Layout(
        size=len(payload),
        order=order,
        names=tuple(names),
        offsets=(offsets[0], offsets[1], offsets[2]),
        counts=(counts[0], counts[1], counts[2]),
        fixed=np.array(fixed, dtype=np.int64),
    )


def same_layout(rows: Bytes, layout: Layout, payload: bytes) -> NDArray[np.bool_]:
    """Tell which rows (n, size) have the layout that was read from `payload`."""
    first = np.frombuffer(payload, dtype=np.uint8)
    same: NDArray[np.bool_] = (rows[:, layout.fixed] == first[layout.fixed]).all(axis=1)
    return same


def decode_rows(rows: Bytes, layout: Layout) -> tuple[NDArray[np.int64], tuple[Floats, Floats, Floats]]:
    """Return stamps in ns (n,) and position, velocity, effort (n, count) of messages of one layout."""
    stamp = np.ascontiguousarray(rows[:, _STAMP])
    seconds = stamp[:, :4].copy().view(layout.order + "i4")[:, 0].astype(np.int64)
    nanoseconds = stamp[:, 4:].copy().view(layout.order + "u4")[:, 0].astype(np.int64)

    def doubles(which: int) -> Floats:
        start, count = layout.offsets[which], layout.counts[which]
        block = np.ascontiguousarray(rows[:, start : start + 8 * count])
        return block.view(layout.order + "f8").astype(np.float64).reshape(len(rows), count)

    return seconds * 1_000_000_000 + nanoseconds, (doubles(0), doubles(1), doubles(2))


def encode_rows(
    names: tuple[str, ...],
    stamp_ns: NDArray[np.int64],
    values: tuple[Floats | None, Floats | None, Floats | None],
    frame_id: str = "",
) -> Bytes:
    """Serialise n messages at once; returns their bytes as a table (n, size), little-endian CDR.

    `values` are position, velocity, effort, each (n, j) or None for an empty sequence.
    """
    head = bytearray(b"\x00\x01\x00\x00" + bytes(8))

    def pad(to: int) -> None:
        head.extend(bytes(_align(len(head), to) - len(head)))

    def string(text: str) -> None:
        pad(4)
        raw = text.encode() + b"\x00"
        head.extend(struct.pack("<I", len(raw)) + raw)

    string(frame_id)
    pad(4)
    head.extend(struct.pack("<I", len(names)))
    for name in names:
        string(name)
    blocks: list[tuple[int, Floats]] = []
    for value in values:
        pad(4)
        count = 0 if value is None else value.shape[1]
        head.extend(struct.pack("<I", count))
        if value is not None and count:
            pad(8)
            blocks.append((len(head), value))
            head.extend(bytes(8 * count))
    rows = np.tile(np.frombuffer(bytes(head), dtype=np.uint8), (stamp_ns.size, 1))
    seconds, nanoseconds = np.divmod(stamp_ns, 1_000_000_000)
    rows[:, 4:8] = seconds.astype("<i4").view(np.uint8).reshape(-1, 4)
    rows[:, 8:12] = nanoseconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    for start, value in blocks:
        block = np.ascontiguousarray(value, dtype="<f8")
        rows[:, start : start + 8 * value.shape[1]] = block.view(np.uint8).reshape(stamp_ns.size, -1)
    return rows
