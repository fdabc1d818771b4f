"""One imported signal: where it goes and how its raw numbers are converted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.measured_conditions import FIELD
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.tables.base_units import base_unit
from idloop.records.tables.mapping import Channel, Mapping, Signals, SignBit
from idloop.records.tables.table_files import Table
from idloop.records.tables.unsigned import sign_magnitude, twos_complement
from idloop.records.unwrapping import unwrap

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Signal:
    """One channel read: where it goes, its stamps and values.

    `doubtful`: beginning and length [s] of the holes over which its number of turns is a guess, where it was unwrapped.
    """

    topic: str
    joint: str
    field: str
    unit: str
    stamp_ns: Stamps
    receive_ns: Stamps
    value: Floats
    doubtful: tuple[tuple[float, float], ...] = ()


def assignments(signals: Signals) -> list[tuple[str, str, Channel]]:
    """Return (topic, field, channel) for everything that the mapping assigns."""
    table = [
        ("reference", "position", signals.reference.position),
        ("reference", "velocity", signals.reference.velocity),
        ("excitation", "position", signals.excitation.position),
        ("excitation", "effort", signals.excitation.effort),
        ("joint_states", "position", signals.position),
        ("joint_states", "velocity", signals.velocity),
        ("joint_states", "effort", signals.effort),
        ("joint_command", "effort", signals.command),
    ]
    found = [(topic, field, channel) for topic, field, channels in table for channel in channels]
    named = signals.conditions.items()
    return [*found, *((CONDITIONS, FIELD, one.model_copy(update={"joint": name})) for name, one in named)]


def make_signal(
    topic: str,
    field: str,
    channel: Channel,
    value: Floats,
    stamps: tuple[Stamps, Stamps],
    signals: Signals,
    mapping: Mapping,
) -> Signal:
    """Return a channel as a signal: unwrapped where a range is declared, in the unit in which the topic carries it.

    Parameters
    ----------
    topic, field : str
        Where it goes.
    channel : Channel
    value : ndarray, shape (n,)
        As `convert` gives them.
    stamps : tuple of ndarray of int64, shape (n,)
        When it was, and when it was received [ns].
    signals : Signals
    mapping : Mapping

    Raises
    ------
    InputError
        No joint is named, the unit is none of the field.
    """
    joint = channel.joint or signals.joint
    if not joint:
        raise InputError(f"mapping {mapping.name}: no joint named; add `joint: motor` at the top")
    doubtful: tuple[tuple[float, float], ...] = ()
    if channel.wrap is not None:
        seconds = (stamps[0] - stamps[0][:1].sum()) * 1e-9
        found = unwrap(seconds, value, channel.wrap)
        value, doubtful = found.value, found.doubtful
    kind, what = ("condition", joint) if topic == CONDITIONS else (field, field)
    unit, factor = base_unit(channel.unit, kind, f"mapping {mapping.name}: {topic} {what}")
    return Signal(topic, joint, field, unit, *stamps, value if factor == 1.0 else value * factor, doubtful)


def convert(value: Floats, table: Table | None, channel: Channel) -> Floats:
    """Return decode(raw) * scale * times + offset."""
    if isinstance(channel.decode, SignBit):
        value = sign_magnitude(value, channel.decode.sign_bit)
    elif channel.decode is not None:
        value = twos_complement(value, channel.decode)
    value = value * channel.scale
    if channel.times is not None and table is not None:
        factor = table.numbers(channel.times)
        if factor.size != value.size:
            raise InputError(
                f"{table.path}: column {channel.times!r} has {factor.size} rows, {channel.column!r} {value.size};"
                " they must agree"
            )
        value = value * factor
    return value + channel.offset
