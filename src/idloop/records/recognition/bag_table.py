"""The numbers of a foreign bag as a table whose columns have stamps of their own."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.fields import BagField, bag_fields
from idloop.records.bags.read import read_streams
from idloop.records.bags.stream import JOINT_STATE
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


def bag_table(path: Path, readable: Callable[[BagField], bool] = lambda one: one.count > 1) -> BagTable:
    """Read the numbers of a bag, of those fields that are `readable`.

    Raises InputError: the bag is missing, damaged, or holds no numbers.
    """
    definitions = ready_definitions()
    fields = [one for one in bag_fields(path, definitions=definitions) if readable(one)][:_MOST]
    if not fields:
        raise InputError(f"{path}: no topic carries numbers that change; check that this is the recording")
    with Bag(path, definitions=definitions) as bag:
        streams = read_streams(bag, {one.topic for one in fields})
    pairs = itertools.combinations(streams.values(), 2)
    received = any(share_no_clock(one, other) for one, other in pairs)
    stamps = {name: stream.receive_ns if received else stream.stamp_ns for name, stream in streams.items()}
    begin = min(int(one.min()) for one in stamps.values() if one.size)
    # What is found of the messages shows in no table of their numbers.
    notes = [one.text for stream in streams.values() for one in stream.findings if one.level == "warning"]
    table, found = Table(path, {}, notes=notes), {}
    for one in fields:
        stream = streams[one.topic]
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
