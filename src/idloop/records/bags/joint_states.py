"""sensor_msgs/JointState in CDR, many messages at once.

Consecutive messages of a topic differ in stamp and values only, so the bytes of all messages form a table
whose columns are read (or written) in one step.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array, Integers
from idloop.records.bags.cdr import SECOND, CdrError, CdrWriter, JointLayout, read_layout

Bytes = NDArray[np.uint8]

_STAMP = slice(4, 12)
_MOST_PADDING = 7  # bytes behind the last number
_MOST_LAYOUTS = 32  # more changes of layout than this: message by message is faster


def encode_rows(
    names: tuple[str, ...],
    stamp_ns: Integers,
    values: tuple[Array | None, Array | None, Array | None],
) -> Bytes:
    """Serialise n messages at once; returns their bytes as a table (n, size), little-endian CDR.

    `values` are position, velocity, effort, each (n, j) or None for an empty sequence.
    """
    writer = CdrWriter()
    writer.stamp(0)
    writer.string("")  # frame
    writer.uint32(len(names))
    for name in names:
        writer.string(name)
    for value in values:
        writer.doubles((0.0,) * (0 if value is None else value.shape[1]))
    template = bytes(writer.data)
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (stamp_ns.size, 1))
    seconds, nanoseconds = np.divmod(stamp_ns, SECOND)
    rows[:, 4:8] = seconds.astype("<i4").view(np.uint8).reshape(-1, 4)
    rows[:, 8:12] = nanoseconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    for start, value in zip(read_layout(template).offsets, values, strict=True):
        if value is not None:
            block = np.ascontiguousarray(value, dtype="<f8")
            rows[:, start : start + 8 * value.shape[1]] = block.view(np.uint8).reshape(stamp_ns.size, -1)
    return rows


def decode_rows(rows: Bytes, layout: JointLayout) -> tuple[Integers, tuple[Array, Array, Array]]:
    """Return stamps in ns (n,) and position, velocity, effort (n, count) of messages of one layout."""
    stamp = np.ascontiguousarray(rows[:, _STAMP])
    seconds = stamp[:, :4].copy().view(layout.order + "i4")[:, 0].astype(np.int64)
    nanoseconds = stamp[:, 4:].copy().view(layout.order + "u4")[:, 0].astype(np.int64)

    def doubles(which: int) -> Array:
        start, count = layout.offsets[which], layout.counts[which]
        block = np.ascontiguousarray(rows[:, start : start + 8 * count])
        return block.view(layout.order + "f8").astype(np.float64).reshape(len(rows), count)

    return seconds * SECOND + nanoseconds, (doubles(0), doubles(1), doubles(2))


def decode_joint_states(payloads: Sequence[bytes]) -> tuple[Integers, tuple[str, ...], tuple[Array, Array, Array]]:
    """Decode JointState messages; joints may come, go and change place between messages.

    Returns `stamp_ns` (n,).
    and `names`: in the order of first appearance; positions ``"0"``, ``"1"``, ... where a message names no joint.
    and `values` (n, j): position, velocity, effort; NaN where a message has none.
    Raises CdrError: a message is no JointState.
    """
    stamp = np.zeros(len(payloads), dtype=np.int64)
    parts = []
    for index, rows, layout in _groups(payloads):
        stamp[index], fields = decode_rows(rows, layout)
        parts.append((index, layout.names or tuple(map(str, range(max(layout.counts)))), fields))
    # Column order follows the first appearance in the recording, not the order of decoding.
    parts.sort(key=lambda part: int(part[0][0]))
    order = {name: place for place, name in enumerate(dict.fromkeys(name for _, names, _ in parts for name in names))}
    values = tuple(np.full((len(payloads), len(order)), np.nan) for _ in range(3))
    for index, names, fields in parts:
        columns = np.array([order[name] for name in names], dtype=np.int64)
        for target, block in zip(values, fields, strict=True):
            width = min(block.shape[1], columns.size)
            if width:
                target[index[:, None], columns[None, :width]] = block[:, :width]
    return stamp, tuple(order), (values[0], values[1], values[2])


def _groups(payloads: Sequence[bytes]) -> Iterator[tuple[Integers, Bytes, JointLayout]]:
    """Yield indices, bytes and layout of the messages that have one layout."""
    lengths = np.fromiter(map(len, payloads), dtype=np.int64, count=len(payloads))
    layouts = 0
    for length in np.unique(lengths):
        index = np.flatnonzero(lengths == length).astype(np.int64)
        rows = np.frombuffer(b"".join([payloads[k] for k in index.tolist()]), dtype=np.uint8).reshape(
            index.size, int(length)
        )
        while index.size and layouts < _MOST_LAYOUTS:
            layouts += 1
            layout = plain_layout(payloads[int(index[0])])
            fixed = np.concatenate([np.arange(start, stop) for start, stop in layout.fixed])
            same = (rows[:, fixed] == rows[0, fixed]).all(axis=1)
            yield index[same], rows[same], layout
            index, rows = index[~same], rows[~same]
        left = defaultdict(list)
        for place, k in enumerate(index.tolist()):
            left[plain_layout(payloads[k])].append(place)
        for layout, places in left.items():
            yield index[places], rows[places], layout


def plain_layout(payload: bytes) -> JointLayout:
    """Return the layout of a message that ends behind its last number; CdrError for any other."""
    layout = read_layout(payload)
    if len(payload) > layout.end + _MOST_PADDING:
        raise CdrError(f"{len(payload) - layout.end} bytes behind the last number")
    return layout
