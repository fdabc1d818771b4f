"""A look at a bag before any model: topics, stamps, excitation, and what the data can show."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.records.bags.applied_command import TOLD, told_findings, told_topic
from idloop.records.bags.bag import Bag, resolve_topic
from idloop.records.bags.imported_units import condition_units, imported, said_units
from idloop.records.bags.read import read_streams, readable_topics
from idloop.records.bags.stream import FIELDS, JointStream
from idloop.records.finding import Finding
from idloop.records.inspection.clocks import (
    StampStatistics,
    compare_clocks,
    stamp_findings,
    stamp_statistics,
    while_measured,
)
from idloop.records.inspection.differenced import differenced_columns
from idloop.records.inspection.excitation import Excitation, analyse_command
from idloop.records.inspection.from_rest import beginning
from idloop.records.inspection.insight import Evidence, insights, verdict
from idloop.records.inspection.magnitude import unusable_magnitude
from idloop.records.inspection.measured_input import measured_input
from idloop.records.inspection.motion import Motion, analyse_motion
from idloop.records.inspection.velocity_check import wrong_velocities
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.measured_conditions import ConditionSources
from idloop.records.tables.missing import missing_values
from idloop.spelling import listed

Floats = NDArray[np.float64]

_COMMANDS = ("joint_command", "commands", "command")
_ADDED = ("reference", "excitation", f"/{CONDITIONS}", TOLD, "estimator/prediction", "estimator/residual")
_A_DAY = 86_400.0


@dataclass(frozen=True)
class TopicReport:
    """One topic.

    Attributes
    ----------
    name, type : str
    count : int
        Messages.
    readable : bool
        Whether its numbers could be read.
    stamped : bool
        Whether its messages carry stamps of their own.
    stamps : StampStatistics
        Of the header stamps where there are any, else of the receive times.
    receive : StampStatistics
        Of the receive times.
    delay : dict of str to float
        Receive time minus stamp, ``p50``, ``p99``, ``max`` [s]; empty where the clocks have nothing in common.
    """

    name: str
    type: str
    count: int
    readable: bool
    stamped: bool
    stamps: StampStatistics
    receive: StampStatistics
    delay: dict[str, float]

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return {
            "name": self.name,
            "type": self.type,
            "count": self.count,
            "readable": self.readable,
            "stamped": self.stamped,
            "stamps": self.stamps.to_dict(),
            "receive": self.receive.to_dict(),
            "delay": self.delay,
        }


@dataclass(frozen=True)
class ConditionReport:
    """What was measured of one condition.

    Attributes
    ----------
    unit : str
        Empty where the bag does not say.
    count : int
        Values.
    minimum, maximum : float
    """

    unit: str
    count: int
    minimum: float
    maximum: float


@dataclass(frozen=True)
class Inspection:
    """What `inspect_bag` found.

    Attributes
    ----------
    path : Path
    topics : tuple of TopicReport
    commands : dict of str to Excitation
        By ``joint.field``.
    signals : dict of str to dict of str to Motion
        Measured signals: topic to ``joint.field`` to numbers.
    conditions : dict of str to ConditionReport
        What was measured beside the axis, by name.
    units : dict of str to str
        Units by ``joint.field``, where the bag states them.
    findings : tuple of Finding
    insights : tuple of str
        What this data can show, in sentences.
    verdict : str
        ``usable``, ``short``, ``too_short``, ``contradictory``, ``several_runs``, ``not_excited``, ``no_command`` or
        ``unreadable``.
    left_out : tuple of str
        Velocities that fits go on without, for they are none of the recorded positions.
    streams : dict of str to JointStream
        The data itself, for plots.
    command_topic : str
        "" when none was found.
    """

    path: Path
    topics: tuple[TopicReport, ...]
    commands: dict[str, Excitation]
    signals: dict[str, dict[str, Motion]]
    units: dict[str, str]
    findings: tuple[Finding, ...]
    insights: tuple[str, ...]
    verdict: str
    command_topic: str
    conditions: dict[str, ConditionReport] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    imported: dict[str, Any] = field(default_factory=dict)
    streams: dict[str, JointStream] = field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, object]:
        """Return plain values, schema ``idloop/inspect/1``."""
        return {
            "schema": "idloop/inspect/1",
            "bag": str(self.path),
            "verdict": self.verdict,
            "left_out": list(self.left_out),
            "insights": list(self.insights),
            "topics": [topic.to_dict() for topic in self.topics],
            "command_topic": self.command_topic,
            "commands": {name: command.to_dict() for name, command in self.commands.items()},
            "signals": {
                topic: {name: motion.to_dict() for name, motion in motions.items()}
                for topic, motions in self.signals.items()
            },
            "conditions": {name: asdict(condition) for name, condition in self.conditions.items()},
            "units": self.units,
            "findings": [finding.to_dict() for finding in self.findings],
            "imported": self.imported,
        }


def inspect_bag(
    path: Path | str,
    *,
    command: str | None = None,
    distro: str | None = None,
    definitions: Mapping[str, str] | None = None,
) -> Inspection:
    """Look at a bag: rates, stamps, excitation, and what can be learnt from it.

    Parameters
    ----------
    path : Path or str
        Bag.
    command : str, optional
        Topic of the command; by default ``joint_command``, or a topic that ends in ``commands``.
    distro : str, optional
        ROS distribution of message types that the bag does not define.
    definitions : mapping of str to str, optional
        Definitions of further message types; those of the ready mappings are known anyway.

    Raises
    ------
    InputError
        Bag missing, empty, damaged, or `command` not in it.
    """
    path = Path(path)
    with Bag(path, distro, _ready_definitions() | dict(definitions or {})) as bag:
        streams = read_streams(bag)
        read = set(readable_topics(bag))
        receive = bag.receive_stamps([topic for topic in bag.topics if topic not in streams])
        custom = bag.custom
        topics = bag.topics
        asked = _command_topic(streams, topics, command, path)
        command_topic = told_topic(asked, topics) if command is None and asked else asked
    known = (asked, command_topic)
    measured = {name: stream for name, stream in streams.items() if name not in known and not name.endswith(_ADDED)}
    reports = []
    findings: list[Finding] = []
    for topic in topics.values():
        stream = streams.get(topic.name)
        received = stream.receive_ns if stream is not None else receive[topic.name]
        stamps = stream.stamp_ns if stream is not None else received
        if topic.name == command_topic:
            stamps = while_measured(stamps, [one.stamp_ns for one in measured.values()])
        report = TopicReport(
            name=topic.name,
            type=topic.type,
            count=int(received.size),
            readable=topic.name in read,
            stamped=stream is not None and stream.stamped,
            stamps=stamp_statistics(stamps),
            receive=stamp_statistics(received),
            delay=_delay(stream) if stream is not None else {},
        )
        reports.append(report)
        if topic.count == 0:
            findings.append(Finding("no_messages", f"{topic.name}: no message recorded", where=topic.name))
            continue
        if topic.type in bag.unknown_types:
            findings.append(
                Finding(
                    "unread_topic",
                    f"{topic.name}: type {topic.type} is unknown, its content was not read",
                    topic.count,
                    topic.name,
                    "warning",
                )
            )
        if stream is not None:
            findings += stream.findings
            # A bridge speaks when it has something to say; until then its word holds.
            if not topic.name.endswith((f"/{TOLD}", f"/{CONDITIONS}")):
                announced, held = topic.name.endswith(_ADDED), topic.name == command_topic
                findings += stamp_findings(topic.name, report.stamps, announced=announced, held=held)
    units = said_units(custom)
    signals = {name: found for name, stream in measured.items() if (found := _motions(stream))}
    findings += _value_findings(signals)
    left_out = []
    for stream in (one for one in measured.values() if one.stamp_ns.size):
        wrong = _wrong_velocities(stream, units)
        left_out += [one.where for one in wrong]
        good = {name: column for name, column in columns_of(stream).items() if name not in left_out}
        findings += [*wrong, *differenced_columns((stream.stamp_ns - stream.stamp_ns[0]) * 1e-9, good)]
    commands = _commands(streams[command_topic]) if command_topic else {}
    findings += _missing(measured, command=False)
    findings += told_findings(asked, command_topic)
    if command_topic:
        findings += _missing({command_topic: streams[command_topic]}, command=True)
        findings += _clock_findings(streams, command_topic, measured)
        findings += _measured_input(streams[command_topic], commands, measured)
    beside = ConditionSources((), next((name for name in streams if name.endswith(f"/{CONDITIONS}")), ""))
    usable = {
        topic: {name: motion for name, motion in found.items() if name not in left_out}
        for topic, found in signals.items()
    }
    evidence = _evidence(streams, command_topic, commands, measured, usable, units)
    return Inspection(
        path=path,
        topics=tuple(reports),
        commands=commands,
        signals=signals,
        units=units,
        findings=tuple(findings),
        insights=tuple(insights(evidence)),
        verdict=verdict(evidence),
        left_out=tuple(left_out),
        command_topic=command_topic,
        conditions=_conditions(beside, streams, condition_units(custom)),
        imported=imported(custom),
        streams=streams,
    )


@functools.cache
def _ready_definitions() -> dict[str, str]:
    """Message types that the ready mappings define; read once, for reading them takes longer than many a bag."""
    # Only here: validation of mapping files is slow to load.
    from idloop.records.tables.mapping import load_mapping, ready_mappings

    return {name: text for ready in ready_mappings() for name, text in load_mapping(ready).definitions.items()}


def _command_topic(
    streams: Mapping[str, JointStream], topics: Mapping[str, object], said: str | None, path: Path
) -> str:
    if said is not None:
        topic = resolve_topic(said, topics, path)
        if topic not in streams:
            raise InputError(
                f"{path}: {topic} carries no numbers that could be a command; readable are {listed(streams)}"
            )
        return topic
    for ending in _COMMANDS:
        found = [topic for topic in streams if topic.rsplit("/", 1)[-1] == ending]
        if found:
            return found[0]
    return ""


def _conditions(
    beside: ConditionSources, streams: Mapping[str, JointStream], units: Mapping[str, str]
) -> dict[str, ConditionReport]:
    found, _ = beside.read(streams, units, 0, np.iinfo(np.int64).max)
    return {
        one.name: ConditionReport(one.unit, one.value.size, float(one.value.min()), float(one.value.max()))
        for one in found
    }


def _delay(stream: JointStream) -> dict[str, float]:
    if not stream.stamped:
        return {}
    delay = (stream.receive_ns - stream.stamp_ns).astype(np.float64) * 1e-9
    if abs(float(np.median(delay))) > _A_DAY:
        return {}  # stamps of a simulation against a wall clock
    p50, p99 = np.percentile(delay, [50, 99])
    return {"p50": float(p50), "p99": float(p99), "max": float(delay.max())}


def columns_of(stream: JointStream) -> dict[str, Floats]:
    """Return the measured columns of a stream by ``joint.field``, or by path for other types."""
    if not stream.is_joint_state:
        return {name: stream.position[:, index] for index, name in enumerate(stream.names)}
    found = {}
    for index, joint in enumerate(stream.names):
        for name in FIELDS:
            column = getattr(stream, name)[:, index]
            if not np.isnan(column).all():
                found[f"{joint}.{name}"] = column
    return found


def _wrong_velocities(stream: JointStream, units: Mapping[str, str]) -> list[Finding]:
    """Say which velocities are none of their joints' positions; of two samples with one stamp the first counts."""
    stamp, first = np.unique(stream.stamp_ns, return_index=True)
    columns = {name: column[first] for name, column in columns_of(stream).items()}
    return wrong_velocities((stamp - stamp[0]) * 1e-9, columns, units)


def _motions(stream: JointStream) -> dict[str, Motion]:
    columns = columns_of(stream)
    found = {name: analyse_motion(columns[name], velocity=name.endswith(".velocity")) for name in columns}
    return {name: motion for name, motion in found.items() if motion is not None}


def _commands(stream: JointStream) -> dict[str, Excitation]:
    stamp, first = np.unique(stream.stamp_ns, return_index=True)
    time = (stamp - stamp[0]) * 1e-9
    found = {}
    for name, column in columns_of(stream).items():
        value = column[first]
        known = np.isfinite(value)
        if known.any():
            found[name] = analyse_command(time[known], value[known])
    return found


def _value_findings(signals: Mapping[str, Mapping[str, Motion]]) -> list[Finding]:
    return [
        Finding("infinite", f"{topic} {name}: {motion.infinite} infinite samples", motion.infinite, topic, "warning")
        for topic, motions in signals.items()
        for name, motion in motions.items()
        if motion.infinite
    ] + [
        Finding("magnitude", text, where=topic, level="warning")
        for topic, motions in signals.items()
        for name, motion in motions.items()
        if (text := unusable_magnitude(name, motion.minimum, motion.maximum))
    ]


def _missing(streams: Mapping[str, JointStream], *, command: bool) -> list[Finding]:
    found = []
    for topic, stream in streams.items():
        columns = {name: column for name, column in columns_of(stream).items() if np.isfinite(column).any()}
        for name, column in columns.items():
            held = command and len(columns) == 1
            found += missing_values(f"{topic} {name}", stream.stamp_ns, column, topic, command=held)
    return found


def _measured_input(
    command: JointStream, commands: Mapping[str, Excitation], measured: Mapping[str, JointStream]
) -> list[Finding]:
    """Say that the strongest command was measured, where the motion of its joint shows it."""
    if not commands:
        return []
    name = max(commands, key=lambda key: commands[key].rms)
    joint, columns = name.rpartition(".")[0], columns_of(command)
    for stream in measured.values():
        begin = min(command.stamp_ns[0], stream.stamp_ns[0])
        motions = {key: value for key, value in columns_of(stream).items() if key.rpartition(".")[0] == joint}
        given, told = (1e-9 * (one.stamp_ns - begin) for one in (command, stream))
        if found := measured_input(name, given, columns[name], told, motions):
            return found
    return []


def _clock_findings(
    streams: Mapping[str, JointStream], command: str, measured: Mapping[str, JointStream]
) -> list[Finding]:
    found = []
    for name, stream in measured.items():
        clocks = compare_clocks(
            (streams[command].stamp_ns, streams[command].receive_ns), (stream.stamp_ns, stream.receive_ns)
        )
        where = f"{command}, {name}"
        if clocks.overlap < 0:
            found.append(
                Finding("two_clocks", f"stamps of {where} do not overlap: two clocks", where=where, level="warning")
            )
        elif np.isfinite(clocks.drift) and abs(clocks.drift) > 5e-5 and abs(clocks.drifted) > 0.02:
            text = f"stamps of {where} drift apart by {clocks.drift * 1e6:.0f} ppm: perhaps two clocks"
            found.append(Finding("clock_drift", text, where=where, level="warning"))
    return found


def _evidence(
    streams: Mapping[str, JointStream],
    command_topic: str,
    commands: Mapping[str, Excitation],
    measured: Mapping[str, JointStream],
    signals: Mapping[str, Mapping[str, Motion]],
    units: Mapping[str, str],
) -> Evidence:
    motions = {name: motion for found in signals.values() for name, motion in found.items()}
    # Of several driven joints the strongest command speaks for the recording.
    name = max(commands, key=lambda key: commands[key].rms, default=None)
    stamps = [stamp_statistics(measured[topic].stamp_ns) for topic in signals]
    if command_topic:
        stamps.append(stamp_statistics(streams[command_topic].stamp_ns))
    return Evidence(
        command=commands[name] if name is not None else None,
        motions=motions,
        units=units,
        closed_loop=any(topic.rsplit("/", 1)[-1] == "reference" for topic in streams),
        sample_rate=max((one.rate for one in stamps[: len(signals)]), default=float("nan")),
        coasting=_coasting(streams[command_topic], name, measured) if name is not None else 0.0,
        runs=1 + max((len(one.resets) for one in stamps), default=0),
        from_rest=any(
            beginning(1e-9 * (one.stamp_ns - one.stamp_ns[0]), column, velocity=signal.endswith(".velocity"))[0]
            == "from rest"
            for one in (measured[topic] for topic in signals)
            for signal, column in columns_of(one).items()
            if signal in motions and signal.endswith((".position", ".velocity"))
        ),
    )


def _coasting(command: JointStream, name: str, measured: Mapping[str, JointStream]) -> float:
    """Return the longest time with zero command while some velocity is above 5 % of its largest value [s]."""
    value = columns_of(command)[name]
    longest = 0.0
    for stream in measured.values():
        for signal, velocity in columns_of(stream).items():
            if not signal.endswith(".velocity"):
                continue
            index = np.searchsorted(command.stamp_ns, stream.stamp_ns, side="right") - 1
            coasts = (
                (index >= 0)
                & (value[np.maximum(index, 0)] == 0)
                & (np.abs(velocity) > 0.05 * np.nanmax(np.abs(velocity)))
            )
            edges = np.flatnonzero(np.diff(np.concatenate([[0], coasts.astype(np.int8), [0]])))
            for start, stop in zip(edges[::2], edges[1::2], strict=True):
                longest = max(longest, float(stream.stamp_ns[stop - 1] - stream.stamp_ns[start]) * 1e-9)
    return longest
