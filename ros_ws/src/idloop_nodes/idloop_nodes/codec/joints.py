"""JointState, Header and Clock: bytes to values and back, fast enough for every sample of a loop."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from idloop_nodes.codec.cdr import HEADER, CdrError, CdrReader, CdrWriter

SECOND = 1_000_000_000
FIELDS = ("position", "velocity", "effort")
NAN = math.nan
_STAMP = struct.Struct("<iI")


@dataclass(frozen=True)
class JointSample:
    """One sensor_msgs/JointState.

    Attributes
    ----------
    stamp_ns : int
        Header stamp in nanoseconds.
    names : tuple of str
        Joint names.
    position, velocity, effort : tuple of float
        One value per joint, or empty where the message carries none.
    frame_id : str
        Frame of the header.
    """

    stamp_ns: int
    names: tuple[str, ...]
    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    frame_id: str = ""


def peek_stamp(data: bytes) -> int:
    """Return the stamp in nanoseconds of any message that starts with a header or a time."""
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * SECOND + int(nanoseconds)


def _write_stamp(writer: CdrWriter, stamp_ns: int) -> None:
    writer.int32(stamp_ns // SECOND)
    writer.uint32(stamp_ns % SECOND)


def _read_stamp(reader: CdrReader) -> int:
    seconds = reader.int32()
    return seconds * SECOND + reader.uint32()


def encode_time(stamp_ns: int) -> bytes:
    """Return rosgraph_msgs/Clock (or builtin_interfaces/Time) as bytes."""
    return HEADER + _STAMP.pack(stamp_ns // SECOND, stamp_ns % SECOND)


def decode_time(data: bytes) -> int:
    """Return the nanoseconds of a rosgraph_msgs/Clock."""
    return _read_stamp(CdrReader(data))


def encode_header(stamp_ns: int, frame_id: str) -> bytes:
    """Return std_msgs/Header as bytes."""
    writer = CdrWriter()
    _write_stamp(writer, stamp_ns)
    writer.string(frame_id)
    return writer.finish()


def decode_header(data: bytes) -> tuple[int, str]:
    """Return stamp in nanoseconds and frame of a std_msgs/Header."""
    reader = CdrReader(data)
    return _read_stamp(reader), reader.string()


def encode_joint_state(sample: JointSample) -> bytes:
    """Return sensor_msgs/JointState as bytes."""
    writer = CdrWriter()
    _write_stamp(writer, sample.stamp_ns)
    writer.string(sample.frame_id)
    writer.uint32(len(sample.names))
    for name in sample.names:
        writer.string(name)
    for values in (sample.position, sample.velocity, sample.effort):
        writer.uint32(len(values))
        if values:
            writer.align(8)
            writer.data += struct.pack(f"<{len(values)}d", *values)
    return writer.finish()


def decode_joint_state(data: bytes) -> JointSample:
    """Return the content of a sensor_msgs/JointState.

    Raises
    ------
    CdrError
        When the bytes are cut short or no JointState.
    """
    reader = CdrReader(data)
    stamp = _read_stamp(reader)
    frame = reader.string()
    names = tuple(reader.string() for _ in range(_count(reader, 5)))
    columns: list[tuple[float, ...]] = []
    for _ in FIELDS:
        size = _count(reader, 8)
        if size:
            reader.align(8)
        columns.append(struct.unpack(f"<{size}d", reader.take(8 * size)))
    return JointSample(stamp, names, columns[0], columns[1], columns[2], frame)


def _count(reader: CdrReader, item_size: int) -> int:
    """Read a sequence length; refuse one that the remaining bytes cannot hold."""
    size = reader.uint32()
    if size * item_size > len(reader.data):
        raise CdrError(f"a sequence of {size} items cannot be in {len(reader.data)} bytes")
    return size


class JointWriter:
    """Packs JointState messages of one shape: only stamp and numbers change.

    Parameters
    ----------
    names : sequence of str
        Joints.
    fields : sequence of str
        Which of position, velocity, effort are filled (one value per joint each).
    """

    def __init__(self, names: Sequence[str], fields: Sequence[str]) -> None:
        unknown = set(fields) - set(FIELDS)
        if unknown:
            raise ValueError(f"unknown JointState fields: {sorted(unknown)}")
        self.names = tuple(names)
        self.fields = tuple(field for field in FIELDS if field in fields)
        blank = (NAN,) * len(self.names)
        position, velocity, effort = (blank if field in self.fields else () for field in FIELDS)
        template = encode_joint_state(JointSample(0, self.names, position, velocity, effort))
        layout = _Layout(template)
        # One call packs everything: stamp, what stays between the numbers, and the numbers.
        form, at = "<4siI", 12
        fixed: list[bytes] = []
        for field in self.fields:
            if self.names:
                start = layout.starts[field]
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


class _Layout:
    """Where the numbers of one shape of JointState lie."""

    def __init__(self, data: bytes) -> None:
        reader = CdrReader(data)
        reader.take(8)
        reader.string()
        self.names = tuple(reader.string() for _ in range(_count(reader, 5)))
        reader.align(4)
        self.names_end = reader.at
        self.count_at: list[int] = []
        self.counts: list[int] = []
        self.starts: dict[str, int] = {}
        for field in FIELDS:
            reader.align(4)
            self.count_at.append(reader.at)
            size = _count(reader, 8)
            self.counts.append(size)
            if size:
                reader.align(8)
                self.starts[field] = reader.at
            reader.take(8 * size)
        self.end = reader.at
        self._marks = struct.Struct("<12x" + "".join(self._forms())).unpack_from
        self._shape = self._marks(data)

    def _forms(self) -> Iterator[str]:
        """Yield what takes out all that lies between stamp and end and is no number: names and counts."""
        yield f"{self.names_end - 12}s"
        at = self.names_end
        for start in self.count_at:
            yield f"{start - at}x4s"
            at = start + 4

    def matches(self, data: bytes) -> bool:
        """Tell whether `data` has this very shape (padding between names may hold anything)."""
        return len(data) >= self.end and self._marks(data) == self._shape


class JointReader:
    """Takes chosen joints and fields out of JointState messages, fast while their shape repeats.

    Parameters
    ----------
    wanted : sequence of (joint, field)
        What to take, in this order; NaN stands where a message has no such joint or field. The joint
        ``*`` is the first joint of the message, whatever its name.
    """

    def __init__(self, wanted: Sequence[tuple[str, str]]) -> None:
        self.wanted = tuple(wanted)
        self._layout: _Layout | None = None
        self._pick: Callable[[bytes], tuple[float, ...]] = lambda data: ()

    def read(self, data: bytes) -> tuple[int, tuple[float, ...]]:
        """Return stamp in nanoseconds and the wanted values.

        Raises
        ------
        CdrError
            When the bytes are cut short or no JointState.
        """
        if self._layout is None or not self._layout.matches(data):
            self._learn(data)
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        return seconds * SECOND + nanoseconds, self._pick(data)

    @property
    def names(self) -> tuple[str, ...]:
        """Joints of the newest message; none before the first."""
        return () if self._layout is None else self._layout.names

    def _learn(self, data: bytes) -> None:
        layout = _Layout(data)
        offsets: list[int | None] = []
        for joint, field in self.wanted:
            start = layout.starts.get(field)
            index = 0 if joint == "*" else layout.names.index(joint) if joint in layout.names else -1
            known = start is not None and 0 <= index < layout.counts[FIELDS.index(field)]
            offsets.append(start + 8 * index if known and start is not None else None)
        self._pick = _picker(offsets)
        self._layout = layout


def _picker(offsets: Sequence[int | None]) -> Callable[[bytes], tuple[float, ...]]:
    """Return a function that reads doubles at `offsets`, in one call when they ascend."""
    known = [offset for offset in offsets if offset is not None]
    if len(known) == len(offsets) and known == sorted(set(known)) and known:
        gaps = [b - a - 8 for a, b in pairwise(known)]
        form = struct.Struct("<d" + "".join(f"{gap}xd" for gap in gaps))
        return lambda data: form.unpack_from(data, known[0])
    one = struct.Struct("<d")
    return lambda data: tuple(NAN if at is None else one.unpack_from(data, at)[0] for at in offsets)
