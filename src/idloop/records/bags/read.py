"""Topics of a bag as arrays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.bags.bag import Bag, Topic, resolve_topic
from idloop.records.bags.cdr import decode_rows, read_layout, same_layout
from idloop.records.bags.message_fields import carries_signals, decode_any
from idloop.records.bags.stream import JOINT_STATE, JointStream
from idloop.records.finding import Finding

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Result = TypeVar("Result")
_MOST_LAYOUTS = 32  # more changes of layout than this: message by message is faster


def read_streams(
    bag: Path | str | Bag,
    topics: Collection[str] | None = None,
    *,
    distro: str | None = None,
    definitions: Mapping[str, str] | None = None,
) -> dict[str, JointStream]:
    """Read topics of a bag into arrays.

    Parameters
    ----------
    bag : Path, str or Bag
        rosbag2 directory (mcap or sqlite3), a single ``.mcap`` or ``.db3`` file, or a bag already open.
    topics : collection of str, optional
        Topics to read, with or without namespace. Without it every topic that holds numbers of an axis is
        read; images, texts and topics of unknown type are passed over.
    distro : str, optional
        ROS distribution of message types that the bag does not define itself (``humble`` to ``lyrical``).
    definitions : mapping of str to str, optional
        Definitions of further message types, type name to ``.msg`` text.

    Returns
    -------
    dict of str to JointStream
        By topic name as recorded.

    Raises
    ------
    InputError
        Bag missing, empty or damaged; topic unknown, of unknown type or without numbers.
    """
    if not isinstance(bag, Bag):
        with Bag(bag, distro, definitions) as opened:
            return read_streams(opened, topics)
    known = bag.topics
    if topics is None:
        wanted = [known[name] for name in readable_topics(bag)]
    else:
        wanted = [known[resolve_topic(name, known, bag.path)] for name in topics]
        for topic in wanted:
            _check_readable(bag, topic)
    raw = bag.raw([topic.name for topic in wanted])
    streams = {}
    for topic in wanted:
        receive, payloads = raw[topic.name]
        if not payloads:
            raise InputError(
                f"{bag.path}: {topic.count} messages are said to be on {topic.name} and none is there; the file is"
                f" damaged, copy it again, or save the rest with `idloop recover {bag.path}`"
            )
        streams[topic.name] = decode_stream(bag, topic, np.array(receive, dtype=np.int64), payloads)
    return streams


def readable_topics(bag: Bag) -> list[str]:
    """Return the topics of a bag that hold messages with numbers of an axis."""
    return [topic.name for topic in bag.topics.values() if topic.count and _readable(bag, topic)]


def _readable(bag: Bag, topic: Topic) -> bool:
    if topic.type == JOINT_STATE:
        return True
    types = bag.typestore.fielddefs
    return topic.type in types and carries_signals(types, topic.type)


def _check_readable(bag: Bag, topic: Topic) -> None:
    if topic.count == 0:
        raise InputError(f"{bag.path}: topic {topic.name} holds no message; check its publisher, then record again")
    if topic.type == JOINT_STATE:
        return
    if topic.type not in bag.typestore.fielddefs:
        raise InputError(
            f"{bag.path}: topic {topic.name} has the unknown type {topic.type}; give its .msg text under"
            " `definitions:` of a mapping for `idloop import`"
        )
    if not _readable(bag, topic):
        raise InputError(
            f"{bag.path}: topic {topic.name} has the wrong type {topic.type}; sensor_msgs/msg/JointState or a"
            " type made of numbers is needed"
        )


def _decoded(bag: Bag, topic: Topic, decode: Callable[[], Result]) -> Result:
    try:
        return decode()
    except Exception as error:  # noqa: BLE001 - the bytes may be anything
        reason = " ".join(str(error).split()).rstrip(".")
        raise InputError(
            f"{bag.path}: a message on {topic.name} does not decode as {topic.type} ({reason}); the file is damaged,"
            " copy it again"
        ) from None


def _decode_other(bag: Bag, kind: str, payloads: list[bytes]) -> tuple[Stamps | None, tuple[str, ...], Floats]:
    return decode_any(bag.typestore, kind, payloads)


def decode_stream(bag: Bag, topic: Topic, receive_ns: NDArray[np.int64], payloads: list[bytes]) -> JointStream:
    """Turn serialised messages of one topic into a `JointStream`."""
    findings: list[Finding] = []
    if topic.type == JOINT_STATE:
        decode = partial(decode_joint_states, payloads, lambda: bag.typestore)
        stamps: NDArray[np.int64] | None
        stamps, names, (position, velocity, effort) = _decoded(bag, topic, decode)
    else:
        stamps, names, table = _decoded(bag, topic, partial(_decode_other, bag, topic.type, payloads))
        position = velocity = effort = table
    stamped = stamps is not None and bool(np.any(stamps))
    if not stamped:
        why = "type has no header" if stamps is None else "header stamps are all zero"
        findings.append(
            Finding(
                "receive_stamps",
                f"{topic.name}: no stamps in the messages ({why}); receive times are used, with the transport's"
                " delay and jitter in them",
                len(payloads),
                topic.name,
                "warning",
            )
        )
    return JointStream(
        topic=topic.name,
        stamp_ns=stamps if stamped and stamps is not None else receive_ns,
        receive_ns=receive_ns,
        names=names,
        position=position,
        velocity=velocity,
        effort=effort,
        type=topic.type,
        stamped=stamped,
        findings=tuple(findings),
    )


def decode_joint_states(
    payloads: list[bytes], typestore: Any, *, fast: bool = True
) -> tuple[NDArray[np.int64], tuple[str, ...], tuple[Floats, Floats, Floats]]:
    """Decode JointState messages; joints may come, go and change place between messages.

    Parameters
    ----------
    payloads : list of bytes
        Serialised messages.
    typestore : callable
        Returns the rosbags typestore, called only when needed.
    fast : bool
        Decode all messages of one layout at once where their bytes allow it.

    Returns
    -------
    stamp_ns : ndarray of int64, shape (n,)
    names : tuple of str
    values : three ndarrays, shape (n, j)
        position, velocity, effort.
    """
    count = len(payloads)
    stamp = np.zeros(count, dtype=np.int64)
    parts: list[tuple[NDArray[np.int64], tuple[str, ...], tuple[Floats, Floats, Floats]]] = []
    left = _decode_by_layout(payloads, stamp, parts) if fast else np.arange(count)
    if left.size:
        _decode_one_by_one(payloads, left, stamp, parts, typestore())
    # Column order follows the first appearance in the recording, not the order of decoding.
    order: dict[str, int] = {}
    for _, names, _ in sorted(parts, key=lambda part: int(part[0][0])):
        for name in names:
            order.setdefault(name, len(order))
    values = tuple(np.full((count, len(order)), np.nan) for _ in range(3))
    for rows, names, fields in parts:
        columns = np.array([order[name] for name in names], dtype=np.int64)
        for target, block in zip(values, fields, strict=True):
            width = min(block.shape[1], columns.size)
            if width:
                target[rows[:, None], columns[None, :width]] = block[:, :width]
    return stamp, tuple(order), (values[0], values[1], values[2])


def _joint_names(names: tuple[str, ...], counts: Collection[int]) -> tuple[str, ...]:
    """Return the names, or positions where a message names no joint but carries values."""
    return names or tuple(str(index) for index in range(max(counts, default=0)))


def _decode_by_layout(payloads: list[bytes], stamp: NDArray[np.int64], parts: list[Any]) -> NDArray[np.int64]:
    """Decode message groups of equal layout; returns the indices that are left."""
    lengths = np.fromiter((len(payload) for payload in payloads), dtype=np.int64, count=len(payloads))
    left: list[NDArray[np.int64]] = []
    layouts = 0
    for length in np.unique(lengths):
        index = np.flatnonzero(lengths == length)
        rows = np.frombuffer(b"".join([payloads[k] for k in index]), dtype=np.uint8).reshape(index.size, int(length))
        while index.size:
            payload = payloads[index[0]]
            layout = read_layout(payload) if layouts < _MOST_LAYOUTS else None
            if layout is None:
                left.append(index)
                break
            layouts += 1
            same = same_layout(rows, layout, payload)
            stamp[index[same]], fields = decode_rows(rows[same], layout)
            parts.append((index[same], _joint_names(layout.names, layout.counts), fields))
            index, rows = index[~same], rows[~same]
    return np.concatenate(left) if left else np.zeros(0, dtype=np.int64)


def _decode_one_by_one(
    payloads: list[bytes], index: NDArray[np.int64], stamp: NDArray[np.int64], parts: list[Any], typestore: Typestore
) -> None:
    groups: dict[tuple[tuple[str, ...], tuple[int, ...]], list[tuple[int, Any]]] = {}
    for k in index:
        message: Any = typestore.deserialize_cdr(payloads[k], JOINT_STATE)
        stamp[k] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        counts = (len(message.position), len(message.velocity), len(message.effort))
        groups.setdefault((_joint_names(tuple(message.name), counts), counts), []).append((int(k), message))
    for (names, _), members in groups.items():
        rows = np.array([k for k, _ in members], dtype=np.int64)
        fields = tuple(
            np.array([getattr(message, field) for _, message in members], dtype=np.float64).reshape(len(members), -1)
            for field in ("position", "velocity", "effort")
        )
        parts.append((rows, names, fields))
