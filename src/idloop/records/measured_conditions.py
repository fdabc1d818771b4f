"""Conditions that a bag holds beside the axis, such as a temperature or the supply.

A bag of ours has them all on the topic ``conditions``, a JointState with the names of the conditions in the place of
joints and their values as positions. For other bags the model names the topics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Integers
from idloop.physics.conditions import Condition
from idloop.physics.model import ConditionSource
from idloop.records.bags.stream import JointStream
from idloop.records.bags.topics import topics_named
from idloop.records.finding import Finding

TOPIC, FIELD = "conditions", "position"


@dataclass(frozen=True)
class ConditionSources:
    """Topics of a bag that hold conditions."""

    named: tuple[tuple[ConditionSource, str], ...]  # conditions that the model names and the bag has, with the topic
    ours: str  # the topic ``conditions``; empty where there is none

    @classmethod
    def of(cls, signals: Sequence[ConditionSource], ours: str, topics: Mapping[str, object]) -> ConditionSources:
        """Find them; a missing condition is an error only for an effect that depends on it."""
        named = [(one, found[0]) for one in signals if len(found := topics_named(one.topic, topics)) == 1]
        return cls(tuple(named), ours if ours in topics else "")

    @property
    def topics(self) -> tuple[str, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys(filter(None, [*(topic for _, topic in self.named), self.ours])))

    def read(
        self, streams: Mapping[str, JointStream], units: Mapping[str, str], start_ns: int, end_ns: int
    ) -> tuple[tuple[Condition, ...], list[Finding]]:
        """Conditions of one run from its first to its last measurement [ns], and findings on them.

        `units`: units that the bag states, by condition.
        """
        sources = list(self.named)
        known = {source.name for source, _ in sources}
        sources += [
            (ConditionSource(name, self.ours, name, FIELD, units.get(name, "")), self.ours)
            for name in (streams[self.ours].names if self.ours else ())
            if name not in known
        ]
        found, findings = [], []
        for signal, topic in sources:
            stream = streams[topic]
            value = stream.number(signal.joint, signal.field) * signal.scale + signal.offset
            finite = np.isfinite(value)
            stamp, first = np.unique(stream.stamp_ns[finite], return_index=True)
            if not stamp.size:
                findings.append(Finding("no_condition", f"{topic} {signal.name}: no message has a value", where=topic))
                continue
            if stamp[0] > end_ns or (stamp[-1] < start_ns and stamp.size > 1):
                text = f"{topic} {signal.name}: no value between the first and the last measurement; perhaps two clocks"
                findings.append(Finding("two_clocks", text, where=topic, level="warning"))
                continue
            found.append(Condition(signal.name, signal.unit, (stamp - start_ns) / 1e9, value[finite][first]))
        return tuple(found), findings


def conditions_columns(conditions: Sequence[Condition], start_ns: int) -> tuple[Integers, dict[str, Array]]:
    """Stamps [ns] and columns of several conditions on one topic, NaN where one was not measured."""
    stamps = {one.name: start_ns + np.round(one.time * 1e9).astype(np.int64) for one in conditions}
    every = np.unique(np.concatenate(list(stamps.values())))
    columns = {}
    for one in conditions:
        columns[one.name] = np.full(every.size, np.nan)
        columns[one.name][np.searchsorted(every, stamps[one.name])] = one.value
    return every, columns
