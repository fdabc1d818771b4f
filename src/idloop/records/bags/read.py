"""Topics of a bag as arrays."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from idloop.arrays import Integers
from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.joint_states import decode_joint_states
from idloop.records.bags.message_fields import carries_signals, decode_any
from idloop.records.bags.storage.unpacking import damaged, one_line
from idloop.records.bags.stream import JOINT_STATE, JointStream
from idloop.records.bags.topics import Topic, resolve_topic
from idloop.records.finding import Finding


def read_streams(
    bag: Path | str | Bag,
    topics: Collection[str] | None = None,
) -> dict[str, JointStream]:
    """Read topics of a bag into arrays.

    `bag`: rosbag2 directory (mcap or sqlite3), a single ``.mcap`` or ``.db3`` file, or a bag already open.
    `topics`: with or without namespace. Without them every topic that holds numbers of an axis is read; images, texts
    and topics of unknown type are passed over.
    Returns: by topic name as recorded.
    Raises InputError: bag missing, empty or damaged; topic unknown, of unknown type or without numbers.
    """
    if not isinstance(bag, Bag):
        with Bag(bag) as opened:
            return read_streams(opened, topics)
    known = bag.topics
    if topics is None:
        wanted = [known[name] for name in readable_topics(bag)]
    else:
        wanted = [known[resolve_topic(name, known, bag.path)] for name in topics]
        for topic in wanted:
            _check_readable(bag, topic)
    # What an open bag was read for once is not decoded again: a robot's joints share their topics.
    new = {topic.name: topic for topic in wanted if topic.name not in bag.decoded}
    for name, (receive, payloads) in bag.raw(new).items():
        topic = new[name]
        if not payloads:
            raise damaged(bag.path, f"{topic.name} should have {topic.count} messages and has none")
        bag.decoded[topic.name] = decode_stream(bag, topic, np.array(receive, dtype=np.int64), payloads)
    return {topic.name: bag.decoded[topic.name] for topic in wanted}


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
        why = "unknown", "give its .msg text under `definitions:` of a mapping for `idloop import`"
    elif not _readable(bag, topic):
        why = "wrong", "sensor_msgs/msg/JointState or a type made of numbers is needed"
    else:
        return
    raise InputError(f"{bag.path}: topic {topic.name} has the {why[0]} type {topic.type}; {why[1]}")


def decode_stream(bag: Bag, topic: Topic, receive_ns: Integers, payloads: list[bytes]) -> JointStream:
    """Turn serialised messages of one topic into a `JointStream`."""
    stamps: Integers | None
    paths: Mapping[str, str] = {}
    try:
        if topic.type == JOINT_STATE:
            stamps, names, (position, velocity, effort) = decode_joint_states(payloads)
        else:
            stamps, names, position, paths = decode_any(bag.typestore, topic.type, payloads)
            velocity = effort = position
    except Exception as error:  # noqa: BLE001 - the bytes may be anything
        what = f"a message on {topic.name} does not decode as {topic.type} ({one_line(error)})"
        raise damaged(bag.path, what) from None
    findings: list[Finding] = []
    announced = bag.announced.get(topic.name, 0)
    if len(payloads) < announced:
        there = f"{len(payloads)} of {announced} messages that the metadata announce are in the files"
        text = f"{topic.name}: {there}; copy the bag again"
        findings.append(Finding("fewer_messages", text, announced - len(payloads), topic.name, "warning"))
    stamped = stamps is not None and bool(np.any(stamps))
    if not stamped:
        why = "the type has no header" if stamps is None else "all header stamps are zero"
        used = "receive times are used, which contain the delay and the jitter of the transport"
        text = f"{topic.name}: the messages carry no stamps ({why}); {used}"
        findings.append(Finding("receive_stamps", text, len(payloads), topic.name, "warning"))
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
        paths=paths,
    )
