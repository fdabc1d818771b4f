"""One imported signal: where it goes and how its raw numbers are converted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.base_units import base_unit
from idloop.records.decode import sign_magnitude, twos_complement
from idloop.records.filtering import unwrap
from idloop.records.mapping import Channel, Mapping, Signals, SignBit
from idloop.records.tables import Table

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Signal:
    """One channel read: where it goes, its stamps and values."""

    topic: str
    joint: str
    field: str
    unit: str
    stamp_ns: Stamps
    receive_ns: Stamps
    value: Floats


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
    return [(topic, field, channel) for topic, field, channels in table for channel in channels]


def target_joint(channel: Channel, signals: Signals, mapping: Mapping) -> str:
    """Return the joint that a channel becomes; InputError when none is named."""
    joint = channel.joint or signals.joint
    if not joint:
        raise InputError(f"mapping {mapping.name}: no joint named; add `joint: motor` at the top")
    return joint


def in_base_units(topic: str, field: str, channel: Channel, value: Floats, mapping: Mapping) -> tuple[str, Floats]:
    """Return the unit in which the topic carries a channel, and its values in it."""
    unit, factor = base_unit(channel.unit, field, f"mapping {mapping.name}: {topic} {field}")
    return unit, value if factor == 1.0 else value * factor


def convert(value: Floats, table: Table | None, channel: Channel) -> Floats:
    """Return decode(raw) * scale * times + offset, unwrapped where a range is declared."""
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
    value = value + channel.offset
    return value if channel.wrap is None else unwrap(value, channel.wrap)
