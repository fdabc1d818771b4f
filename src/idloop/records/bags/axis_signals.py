"""Which signals of a bag are command and measurements, where no model names them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from idloop.errors import InputError
from idloop.records.bags.bag import Bag, resolve_topic
from idloop.records.bags.imported_units import said_units
from idloop.records.bags.read import read_streams
from idloop.records.bags.stream import FIELDS, JointStream
from idloop.spelling import did_you_mean, listed


@dataclass(frozen=True)
class AxisSignal:
    """Where a signal is found in a bag.

    Attributes
    ----------
    topic, joint, field, unit : str
        The unit is that of an import, "-" where the bag does not say.
    kind : str
        A command is ``held`` or ``measured``.
    """

    topic: str
    joint: str
    field: str
    unit: str
    kind: str = "held"

    @property
    def name(self) -> str:
        """Name of the signal, such as ``motor.effort``."""
        return f"{self.joint}.{self.field}"


@dataclass(frozen=True)
class AxisSignals:
    """Command and measurements of an axis, as `read_record` takes them."""

    input: AxisSignal
    outputs: tuple[AxisSignal, ...]

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, such as ``motor.position``."""
        return tuple(output.name for output in self.outputs)


def axis_signals(bag: Path | str, outputs: Sequence[str] = (), joint: str | None = None) -> AxisSignals:
    """Find the effort of ``joint_command`` and the fields of ``joint_states`` that move.

    Parameters
    ----------
    bag : Path or str
        rosbag2 directory, ``.mcap`` or ``.db3`` file.
    outputs : sequence of str, optional
        Measurements that are wanted, such as ``motor.velocity``, of any joint; by default every field of the
        commanded joint that moves.
    joint : str, optional
        Commanded joint; needed where ``joint_command`` holds several.

    Raises
    ------
    InputError
        No such topic, several commanded joints, or an output that the bag does not hold.
    """
    with Bag(bag) as opened:
        command, states = (resolve_topic(name, opened.topics, bag) for name in ("joint_command", "joint_states"))
        streams = read_streams(opened, {command, states})
        units = said_units(opened.custom)
    driven = [name.rpartition(".")[0] for name in _known(streams[command]) if name.endswith(".effort")]
    if joint is not None and joint not in driven:
        raise InputError(
            f"{bag}: {command} has no effort of joint {joint!r}; it has {listed(driven)}{did_you_mean(joint, driven)}"
        )
    if joint is None and len(driven) != 1:
        mend = "name one with --joint" if driven else "name the streams with --model"
        raise InputError(f"{bag}: {command} holds the effort of {len(driven)} joints ({listed(driven)}); {mend}")
    chosen = driven[0] if joint is None else joint
    measured = _known(streams[states])
    wanted = list(outputs) or [name for name, moves in measured.items() if moves and _joint(name) == chosen]
    for name in wanted:
        if name not in measured:
            raise InputError(
                f"{bag}: no measured output {name!r} in {states}; it has"
                f" {listed(measured)}{did_you_mean(name, measured)}"
            )
    if not wanted:
        raise InputError(
            f"{bag}: {states} holds no field of joint {chosen!r} that moves; choose from {listed(measured)} with"
            " --output, or name the streams with --model"
        )
    return AxisSignals(
        _signal("joint_command", f"{chosen}.effort", units),
        # Relative names: another bag may have them in another namespace.
        tuple(_signal("joint_states", name, units) for name in wanted),
    )


def moving_commands(bag: Path | str, chosen: AxisSignal) -> tuple[str, ...]:
    """Other joints that the topic of a command moves by the same field.

    Parameters
    ----------
    bag : Path or str
        rosbag2 directory, ``.mcap`` or ``.db3`` file.
    chosen : AxisSignal
        The command that is read.

    Returns
    -------
    tuple of str
        Joints in the order of the topic.
    """
    with Bag(bag) as opened:
        topic = resolve_topic(chosen.topic, opened.topics, bag)
        stream = read_streams(opened, {topic})[topic]
    if not stream.is_joint_state:
        return ()
    moving = [name.rpartition(".") for name, moves in _known(stream).items() if moves]
    return tuple(joint for joint, _, field in moving if field == chosen.field and joint != chosen.joint)


def chosen_outputs(signals: AxisSignals, outputs: Sequence[str]) -> AxisSignals:
    """Leave only some outputs, in the order given; all of them where none is named.

    Raises
    ------
    InputError
        An output that is not among them.
    """
    known = {output.name: output for output in signals.outputs}
    for name in outputs:
        if name not in known:
            raise InputError(f"no output {name!r} in the model; it has {listed(known)}{did_you_mean(name, known)}")
    return replace(signals, outputs=tuple(known[name] for name in outputs)) if outputs else signals


def _joint(name: str) -> str:
    return name.rpartition(".")[0]


def _signal(topic: str, name: str, units: dict[str, str]) -> AxisSignal:
    joint, _, field = name.rpartition(".")
    return AxisSignal(topic, joint, field, units.get(name, "-"))


def _known(stream: JointStream) -> dict[str, bool]:
    """Signals of a stream that were ever measured, and whether each of them moves."""
    found = {}
    for index, joint in enumerate(stream.names):
        for field in FIELDS:
            values = getattr(stream, field)[:, index]
            values = values[np.isfinite(values)]
            if values.size:
                found[f"{joint}.{field}"] = bool(np.ptp(values) > 0)
    return found
