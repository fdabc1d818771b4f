"""Signals from the topics of a foreign bag."""

from __future__ import annotations

from pathlib import Path

from idloop.errors import InputError
from idloop.records.bags.bag import Bag, resolve_topic, topics_named
from idloop.records.bags.read import read_streams
from idloop.records.measured_conditions import bag_column
from idloop.records.tables.mapped_signal import Signal, assignments, convert, make_signal
from idloop.records.tables.mapping import Mapping, Signals


def signals_from_bag(source: Path, mapping: Mapping, signals: Signals) -> list[Signal]:
    """Read what the mapping assigns from the topics of a bag."""
    assigned = assignments(signals)
    with Bag(source, definitions=mapping.definitions) as bag:
        known = bag.topics
        names = {}
        for topic, field, channel in assigned:
            if channel.topic is None:
                raise InputError(
                    f"mapping {mapping.name}: {topic} {field} names a column, but {source} is a bag; give"
                    " `topic:` and `field:`"
                )
            if channel.times is not None:
                raise InputError(
                    f"mapping {mapping.name}: {topic} {field}: `times: {channel.times}` names a column, but {source} is"
                    " a bag; multiply by `scale:`"
                )
            if channel.optional and not topics_named(channel.topic, known):
                continue
            names[channel.topic] = resolve_topic(channel.topic, known, source)
        streams = read_streams(bag, set(names.values()))
    receive = signals.time is not None and signals.time.stamps == "receive"
    found = []
    for topic, field, channel in assigned:
        if channel.topic not in names:
            continue
        stream = streams[names[channel.topic]]
        value = convert(bag_column(stream, channel.source_joint or "", channel.field or ""), None, channel)
        stamps = stream.receive_ns if receive else stream.stamp_ns, stream.receive_ns
        found.append(make_signal(topic, field, channel, value, stamps, signals, mapping))
    if not found:
        raise InputError(f"mapping {mapping.name}: it assigns no topic; add `command:` and `position:` or `velocity:`")
    return found
