"""The numbers of a foreign bag as a table whose columns have stamps of their own."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.metadata import signal_units
from idloop.records.bags.read import read_streams, readable_topics
from idloop.records.bags.stream import JOINT_STATE, JointStream
from idloop.records.inspection.clocks import share_no_clock
from idloop.records.tables.mapping import ready_definitions
from idloop.records.tables.table import Table

# Units of sensor_msgs/JointState as REP 103 has them; the effort is that of the drive, whatever it measures.
_UNITS = {"position": "rad", "velocity": "rad/s"}
# What ros2_control publishes of the hardware, beside what its controllers send there.
_STATES = {JOINT_STATE, "control_msgs/msg/DynamicJointState"}
# Words of topics on which a JointState was sent and not measured.
_SENT = {"command", "commands", "cmd", "reference", "goal", "target", "desired", "excitation"}
_MOST = 200


@dataclass(frozen=True)
class BagField:
    """One number that the messages of a topic carry."""

    topic: str
    type: str  # of the messages
    # `source_joint` and `field` of a mapping file; the joint is "" where the type has none
    joint: str
    field: str
    unit: str  # "" where the bag does not state it


@dataclass(frozen=True)
class BagTable:
    """A bag as a table."""

    table: Table
    fields: dict[str, BagField]  # where a column stands in the bag
    # Whether the times of receipt serve as stamps, because the stamps of the topics have no clock in common
    received: bool

    @property
    def sources(self) -> dict[str, dict[str, str]]:
        """How a mapping file names each column."""
        return {
            name: {"topic": one.topic}
            | ({"source_joint": one.joint} if one.joint else {})
            | ({"field": one.field} if one.field else {})
            for name, one in self.fields.items()
        }

    @property
    def definitions(self) -> dict[str, str]:
        """Definitions of its message types that a mapping has to carry."""
        ready = ready_definitions()
        return {one.type: ready[one.type] for one in self.fields.values() if one.type in ready}

    @property
    def joints(self) -> dict[str, str]:
        """Joint of each column; empty where it has none."""
        return {name: one.joint for name, one in self.fields.items()}


def bag_table(path: Path) -> BagTable:
    """Read the numbers of a bag.

    Raises InputError: the bag is missing, damaged, or holds no numbers.
    """
    with Bag(path, definitions=ready_definitions()) as bag:
        streams, notes = _readable_streams(bag)
        units = signal_units(bag.custom)
    fields = [(stream, one) for stream in streams.values() for one in fields_of(stream, units)][:_MOST]
    if not fields:
        raise InputError(f"{path}: no topic carries numbers that change; check that this is the recording")
    pairs = itertools.combinations(streams.values(), 2)
    received = any(share_no_clock(one, other) for one, other in pairs)
    stamps = {name: stream.receive_ns if received else stream.stamp_ns for name, stream in streams.items()}
    begin = min(int(one.min()) for one in stamps.values())
    # What is found of the messages shows in no table of their numbers.
    notes += [one.text for stream in streams.values() for one in stream.findings if one.level == "warning"]
    table, found = Table(path, {}, notes=notes), {}
    for stream, one in fields:
        # States of joints beside commands were measured.
        measured = one.type in _STATES and not _SENT & set(re.split(r"[/_]", one.topic))
        name = " ".join(filter(None, (one.topic, one.joint, one.field, "measured" if measured else "")))
        clock = f"{one.topic} stamps"
        table.columns[name] = stream.number(one.joint, one.field)
        table.columns.setdefault(clock, 1e-9 * (stamps[one.topic] - begin))
        table.clocks[name], table.units[clock] = clock, "s"
        unit = one.unit or (_UNITS.get(one.field, "") if one.type == JOINT_STATE else "")
        if unit:
            table.units[name] = unit
        found[name] = one
    return BagTable(table, found, received)


def _readable_streams(bag: Bag) -> tuple[dict[str, JointStream], list[str]]:
    """Topics with several messages, and why others whose messages are damaged are left out."""
    names, notes = sorted(readable_topics(bag)), list[str]()
    try:
        found = read_streams(bag, names)
    except InputError:
        found = {}
        for name in names:
            try:
                found |= read_streams(bag, [name])
            except InputError as error:
                notes.append(str(error))
    return {name: stream for name, stream in found.items() if len(stream) > 1}, notes


def fields_of(stream: JointStream, units: dict[str, str]) -> list[BagField]:
    """Return the numbers of a topic with the names by which a mapping file asks for them; those without a value not.

    `units`: by column, where the bag states them.
    """
    columns = {name: value for name, value in stream.columns().items() if np.isfinite(value).any()}
    return [BagField(stream.topic, stream.type, *_address(stream, name), units.get(name, "")) for name in columns]


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
