"""Command and measurements of a bag without a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from idloop.errors import InputError
from idloop.physics.model import ConditionSource, InputSignal
from idloop.records.bags.bag import Bag
from idloop.records.bags.metadata import signal_units
from idloop.records.bags.read import read_streams
from idloop.records.bags.stream import JointStream
from idloop.records.bags.topics import resolve_topic
from idloop.spelling import check_known, listed


@dataclass(frozen=True)
class AxisSignals:
    """Command and measurements of an axis, for `read_record`; a unit is "-" where the bag does not state it."""

    input: InputSignal
    outputs: tuple[InputSignal, ...]
    conditions: tuple[ConditionSource, ...] = ()

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, such as ``motor.position``."""
        return tuple(output.name for output in self.outputs)


def axis_signals(bag: Path | str, outputs: Sequence[str] = (), joint: str | None = None) -> AxisSignals:
    """Find the effort of ``joint_command`` and the fields of ``joint_states`` that move.

    `bag`: rosbag2 directory, ``.mcap`` or ``.db3`` file.
    `outputs`: measurements to read, such as ``motor.velocity``, of any joint; by default every field of the commanded
    joint that moves.
    `joint`: commanded joint; needed where ``joint_command`` holds several.
    Raises InputError: no such topic, several commanded joints, or an output that the bag does not hold.
    """
    with Bag(bag) as opened:
        command, states = (resolve_topic(name, opened.topics, bag) for name in ("joint_command", "joint_states"))
        streams = read_streams(opened, {command, states})
        units = signal_units(opened.custom)
    driven = [name.rpartition(".")[0] for name in _known(streams[command]) if name.endswith(".effort")]
    if joint is not None:
        check_known(joint, driven, f"{bag}: {command} has no effort of joint")
    if joint is None and len(driven) != 1:
        advice = "name one with --joint" if driven else "name the streams with --model"
        raise InputError(f"{bag}: {command} holds the effort of {len(driven)} joints ({listed(driven)}); {advice}")
    chosen = joint or driven[0]
    measured = _known(streams[states])
    wanted = list(outputs) or [name for name, moves in measured.items() if moves and name.rpartition(".")[0] == chosen]
    if not wanted:
        raise InputError(
            f"{bag}: {states} holds no field of joint {chosen!r} that moves; choose from {listed(measured)} with"
            " --output, or name the streams with --model"
        )
    for name in wanted:
        check_known(name, measured, f"{bag}: {states} has no measured output")

    def signal(topic: str, name: str) -> InputSignal:
        own, _, field = name.rpartition(".")
        # Relative names: another bag may have them in another namespace.
        return InputSignal(topic, own, field, units.get(name, "-"))

    return AxisSignals(
        signal("joint_command", f"{chosen}.effort"), tuple(signal("joint_states", name) for name in wanted)
    )


def moving_commands(bag: Path | str, chosen: InputSignal) -> tuple[str, ...]:
    """Other joints whose command changes in the same field of the same topic, in the order of the topic."""
    with Bag(bag) as opened:
        topic = resolve_topic(chosen.topic, opened.topics, bag)
        stream = read_streams(opened, {topic})[topic]
    if not stream.is_joint_state:
        return ()
    moving = [name.rpartition(".") for name, moves in _known(stream).items() if moves]
    return tuple(joint for joint, _, field in moving if field == chosen.field and joint != chosen.joint)


def chosen_outputs(signals: AxisSignals, outputs: Sequence[str]) -> AxisSignals:
    """Leave only some outputs, in the order given; all of them where none is named.

    Raises InputError: an output that is not among them.
    """
    known = {output.name: output for output in signals.outputs}
    for name in outputs:
        check_known(name, known, "the model has no output")
    return replace(signals, outputs=tuple(known[name] for name in outputs)) if outputs else signals


def _known(stream: JointStream) -> dict[str, bool]:
    """Signals of a stream that were ever measured, and whether each of them moves."""
    finite = {name: column[np.isfinite(column)] for name, column in stream.columns().items()}
    return {name: bool(np.ptp(values) > 0) for name, values in finite.items() if values.size}
