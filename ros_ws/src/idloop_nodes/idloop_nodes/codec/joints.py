"""JointState, Header and Clock: bytes to values and back, fast enough for every sample of a loop."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.bags.cdr import HEADER, SECOND, CdrError, CdrReader, CdrWriter, JointLayout, read_layout

if TYPE_CHECKING:
    from idloop.physics import Model


FIELDS = ("position", "velocity", "effort")
NAN = math.nan
_STAMP = struct.Struct("<iI")


@dataclass(frozen=True)
class JointSample:
    """One sensor_msgs/JointState."""

    stamp_ns: int  # header stamp in nanoseconds
    names: tuple[str, ...]  # joint names
    # One value per joint, or empty where the message carries none
    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    frame_id: str = ""  # frame of the header


def peek_stamp(data: bytes) -> int:
    """Return the stamp in nanoseconds of any message that starts with a header or a time."""
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * SECOND + int(nanoseconds)


def encode_time(stamp_ns: int) -> bytes:
    """Return rosgraph_msgs/Clock (or builtin_interfaces/Time) as bytes."""
    return HEADER + _STAMP.pack(stamp_ns // SECOND, stamp_ns % SECOND)


def encode_header(stamp_ns: int, frame_id: str) -> bytes:
    """Return std_msgs/Header as bytes."""
    writer = CdrWriter()
    writer.stamp(stamp_ns)
    writer.string(frame_id)
    return writer.finish()


def decode_header(data: bytes) -> tuple[int, str]:
    """Return stamp in nanoseconds and frame of a std_msgs/Header."""
    reader = CdrReader(data)
    return reader.stamp(), reader.string()


def encode_joint_state(sample: JointSample) -> bytes:
    """Return sensor_msgs/JointState as bytes."""
    writer = CdrWriter()
    writer.stamp(sample.stamp_ns)
    writer.string(sample.frame_id)
    writer.uint32(len(sample.names))
    for name in sample.names:
        writer.string(name)
    for values in (sample.position, sample.velocity, sample.effort):
        writer.doubles(values)
    return writer.finish()


def decode_joint_state(data: bytes) -> JointSample:
    """Return the content of a sensor_msgs/JointState; CdrError when it is none."""
    reader = CdrReader(data)
    stamp, frame = reader.stamp(), reader.string()
    names = tuple(reader.string() for _ in range(reader.count(5)))
    return JointSample(stamp, names, reader.doubles(), reader.doubles(), reader.doubles(), frame)


class JointWriter:
    """Packs JointState messages of joints and filled fields: only stamp and numbers change."""

    def __init__(self, names: Sequence[str], fields: Sequence[str]) -> None:
        unknown = set(fields) - set(FIELDS)
        if unknown:
            raise ValueError(f"unknown JointState fields: {sorted(unknown)}")
        self.names = tuple(names)
        self.fields = tuple(field for field in FIELDS if field in fields)
        blank = (NAN,) * len(self.names)
        position, velocity, effort = (blank if field in self.fields else () for field in FIELDS)
        template = encode_joint_state(JointSample(0, self.names, position, velocity, effort))
        offsets = dict(zip(FIELDS, read_layout(template).offsets, strict=True))
        # One call packs everything: stamp, what stays between the numbers, and the numbers.
        form, at = "<4siI", 12
        fixed: list[bytes] = []
        for field in self.fields:
            if self.names:
                start = offsets[field]
                fixed.append(template[at:start])
                form += f"{start - at}s{len(self.names)}d"
                at = start + 8 * len(self.names)
        self._before = tuple(fixed)
        self._after = template[at:]
        self._pack = struct.Struct(f"{form}{len(self._after)}s").pack

    def pack(self, stamp_ns: int, *columns: Sequence[float]) -> bytes:
        """Return one message; `columns` in the order position, velocity, effort as far as filled."""
        seconds, nanoseconds = divmod(stamp_ns, SECOND)
        if len(columns) == 1 == len(self._before):
            return self._pack(HEADER, seconds, nanoseconds, self._before[0], *columns[0], self._after)
        parts: list[bytes | float] = []
        for before, values in zip(self._before, columns, strict=True):
            parts.append(before)
            parts.extend(values)
        return self._pack(HEADER, seconds, nanoseconds, *parts, self._after)


class JointReader:
    """Takes chosen joints and fields out of JointState messages, fast while their shape repeats.

    `wanted`: what to take, in this order; NaN stands where a message has no such joint or field. The joint ``*`` is the
    first joint of the message, whatever its name.
    """

    def __init__(self, wanted: Sequence[tuple[str, str]]) -> None:
        self.wanted = tuple(wanted)
        self._layout: JointLayout | None = None
        self._pick: Callable[[bytes], tuple[float, ...]] = lambda data: ()
        self._fixed: Callable[[bytes], tuple[object, ...]] = lambda data: ()
        self._shape: tuple[object, ...] = ()

    def read(self, data: bytes) -> tuple[int, tuple[float, ...]]:
        """Return stamp in nanoseconds and the wanted values; CdrError when the bytes are no JointState."""
        if self._layout is None or len(data) < self._layout.end or self._fixed(data) != self._shape:
            self._learn(data)
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        return seconds * SECOND + nanoseconds, self._pick(data)

    @property
    def names(self) -> tuple[str, ...]:
        """Joints of the newest message; none before the first."""
        return () if self._layout is None else self._layout.names

    def _learn(self, data: bytes) -> None:
        layout = read_layout(data)
        if layout.order != "<":
            raise CdrError("not a little-endian CDR message")
        blocks = dict(zip(FIELDS, zip(layout.offsets, layout.counts, strict=True), strict=True))
        offsets: list[int | None] = []
        for joint, field in self.wanted:
            start, count = blocks.get(field, (0, 0))
            index = 0 if joint == "*" else layout.names.index(joint) if joint in layout.names else -1
            offsets.append(start + 8 * index if 0 <= index < count else None)
        self._pick = _picker(offsets)
        self._fixed = _stretches(layout.fixed[1:])  # the byte order of a publisher does not change
        self._shape = self._fixed(data)
        self._layout = layout


def _stretches(places: Sequence[tuple[int, int]]) -> Callable[[bytes], tuple[object, ...]]:
    """Return a function that reads stretches of bytes, from start to stop, in one call; lengths as numbers."""
    form, at = "<", 0
    for start, stop in places:
        form += f"{start - at}x" + ("I" if stop - start == 4 else f"{stop - start}s")
        at = stop
    return struct.Struct(form).unpack_from


def _picker(offsets: Sequence[int | None]) -> Callable[[bytes], tuple[float, ...]]:
    """Return a function that reads doubles at `offsets`, in one call when they ascend."""
    known = [offset for offset in offsets if offset is not None]
    if len(known) == len(offsets) and known == sorted(set(known)) and known:
        gaps = [b - a - 8 for a, b in pairwise(known)]
        form = struct.Struct("<d" + "".join(f"{gap}xd" for gap in gaps))
        return lambda data: form.unpack_from(data, known[0])
    one = struct.Struct("<d")
    return lambda data: tuple(NAN if at is None else one.unpack_from(data, at)[0] for at in offsets)


class OutputPacker:
    """Packs a model's outputs, in their order, into one JointState: NaN where a field is not measured."""

    def __init__(self, outputs: Sequence[tuple[str, str]]) -> None:
        joints = list(dict.fromkeys(joint for joint, _ in outputs))
        fields = [field for field in FIELDS if any(one == field for _, one in outputs)]
        self._columns = [[NAN] * len(joints) for _ in fields]
        self._places = [(fields.index(field), joints.index(joint)) for joint, field in outputs]
        self._as_given = self._places == [(0, joint) for joint in range(len(joints))]
        self._writer = JointWriter(joints, fields)

    def pack(self, stamp_ns: int, values: Sequence[float]) -> bytes:
        """Return the message of one measurement, `values` in the model's order."""
        if self._as_given:
            return self._writer.pack(stamp_ns, values)
        columns = self._columns
        for (column, joint), value in zip(self._places, values, strict=True):
            columns[column][joint] = value
        return self._writer.pack(stamp_ns, *columns)


def output_columns(model: Model) -> list[tuple[str, str]]:
    """Return (joint, field) of every output; InputError when they lie on several topics."""
    topics = {output.topic for output in model.outputs}
    if len(topics) > 1:
        raise InputError(
            f"model {model.name}: the nodes take all outputs from one topic, not {', '.join(sorted(topics))}; "
            "give them one topic in the model file"
        )
    return [(output.joint, output.field) for output in model.outputs]


def output_topic(model: Model) -> str:
    """Return the topic of the model's outputs."""
    return str(model.outputs[0].topic)
