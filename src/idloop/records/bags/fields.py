"""What a bag offers: every number in it, with the names by which a mapping file asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.metadata import signal_units
from idloop.records.bags.read import decode_stream, readable_topics
from idloop.records.bags.stream import JointStream
from idloop.records.bags.topics import Topic

# Messages of a topic that are decoded about, where it has as many, and messages of the bag that are passed over.
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


def bag_fields(path: Path | str, *, definitions: Mapping[str, str] | None = None) -> list[BagField]:
    """List the numbers that a bag offers, from some messages of each topic.

    `path`: bag of any form.
    `definitions`: definitions of further message types.
    Returns: by topic. Topics without numbers of an axis, such as images, and fields without a value are left out.
    Raises InputError: bag missing, empty or damaged.
    """
    with Bag(path, definitions=definitions) as bag:
        units = signal_units(bag.custom)
        topics = bag.topics
        found: list[BagField] = []
        for rate, stream in _sampled(bag, topics):
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
                        rate=rate,
                        unit=units.get(name, ""),
                        stamped=stream.stamped,
                        moves=bool(known.size and np.ptp(known) > 0),
                    )
                )
    return found


def _sampled(bag: Bag, topics: Mapping[str, Topic]) -> Iterator[tuple[float, JointStream]]:
    """Rate [Hz] and some messages of each topic that can be read; those whose messages do not decode are left out."""
    names = sorted(readable_topics(bag))
    passed = min(1.0, _PASSED / max(sum(topics[name].count for name in names), 1))
    every = {name: max(int(passed * topics[name].count) // _SAMPLE, 1) for name in names}
    received: dict[str, list[int]] = {name: [] for name in names}
    kept: dict[str, list[bytes]] = {name: [] for name in names}
    for name, receive, data in islice(bag.messages(names), _PASSED):
        if len(received[name]) % every[name] == 0:
            kept[name].append(data)
        received[name].append(receive)
    for name in names:
        stamps = np.array(received[name], dtype=np.int64)
        span = float(np.ptp(stamps)) if stamps.size else 0.0
        with suppress(InputError):
            if stamps.size:
                stream = decode_stream(bag, topics[name], stamps[:: every[name]], kept[name])
                yield (stamps.size - 1) / span * 1e9 if span > 0.0 else float("nan"), stream


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
