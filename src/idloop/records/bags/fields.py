"""What a bag offers: every number in it, with the names by which a mapping file asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.metadata import signal_units
from idloop.records.bags.read import decode_stream, readable_topics
from idloop.records.bags.stream import JointStream

# Messages of a topic that are decoded at least, where it has as many, and messages of the bag that are passed over.
_SAMPLE, _PASSED = 200, 100_000


@dataclass(frozen=True)
class BagField:
    """One number that the messages of a topic carry."""

    # Name and message type of the topic
    topic: str
    type: str
    # `source_joint` and `field` of a mapping file; the joint is "" where the type has none
    joint: str
    field: str
    count: int  # messages on the topic
    rate: float  # messages per second [Hz], on the clock of the recorder; NaN for fewer than two
    unit: str  # "" where the bag does not state it
    stamped: bool  # whether the messages carry stamps of their own
    moves: bool  # whether the number changes within the messages that were looked at


def bag_fields(
    path: Path | str, *, distro: str | None = None, definitions: Mapping[str, str] | None = None
) -> list[BagField]:
    """List the numbers that a bag offers, from some messages of each topic.

    `path`: bag of any form.
    `distro`: ROS distribution of message types that the bag does not define.
    `definitions`: definitions of further message types.
    Returns: by topic. Topics without numbers of an axis, such as images, and fields without a value are left out.
    Raises InputError: bag missing, empty or damaged.
    """
    with Bag(path, distro, definitions) as bag:
        units = signal_units(bag.custom)
        topics = bag.topics
        found: list[BagField] = []
        for sample, stream in _sampled(bag):
            for name, values in stream.columns().items():
                joint, own = _address(stream, name)
                known = values[np.isfinite(values)]
                found.append(
                    BagField(
                        topic=stream.topic,
                        type=stream.type,
                        joint=joint,
                        field=own,
                        count=topics[stream.topic].count,
                        rate=sample.rate,
                        unit=units.get(name, ""),
                        stamped=stream.stamped,
                        moves=bool(known.size and np.ptp(known) > 0),
                    )
                )
    return found


@dataclass
class _Sample:
    """Some messages of a topic, evenly chosen while it is passed over."""

    kept: list[tuple[int, bytes]] = field(default_factory=list)
    every: int = 1
    seen: int = 0
    first: int = 0
    last: int = 0

    def add(self, receive: int, data: bytes) -> None:
        """Pass over one message."""
        if self.seen % self.every == 0:
            self.kept.append((receive, data))
        if len(self.kept) > 2 * _SAMPLE:
            del self.kept[1::2]
            self.every *= 2
        self.first = receive if self.seen == 0 else min(self.first, receive)
        self.last = max(self.last, receive)
        self.seen += 1

    @property
    def rate(self) -> float:
        """Messages per second [Hz]."""
        return (self.seen - 1) / (self.last - self.first) * 1e9 if self.last > self.first else float("nan")


def _sampled(bag: Bag) -> Iterator[tuple[_Sample, JointStream]]:
    """Some messages of each topic that can be read; topics whose messages do not decode are left out."""
    samples = {topic: _Sample() for topic in sorted(readable_topics(bag))}
    for topic, receive, data in islice(bag.messages(samples), _PASSED):
        samples[topic].add(receive, data)
    for name, sample in samples.items():
        stamps = np.array([stamp for stamp, _ in sample.kept], dtype=np.int64)
        with suppress(InputError):
            if sample.kept:
                yield sample, decode_stream(bag, bag.topics[name], stamps, [data for _, data in sample.kept])


def _address(stream: JointStream, name: str) -> tuple[str, str]:
    """Joint and field under which `JointStream.number` finds a column."""
    if stream.is_joint_state:
        joint, _, own = name.rpartition(".")
        return joint, own
    place = next((path for path, column in stream.paths.items() if column == name), "")
    if place:
        # Of an array the field is its path; of named values, such as those of one joint, the name of the value.
        path = place.rpartition("[")[0]
        own = path if name.endswith(f".{path}") else name.rpartition(".")[2]
        return name.removesuffix(f".{own}"), own
    if name.isdigit():
        return "", "" if len(stream.names) == 1 else f"data[{name}]"
    return "", name
