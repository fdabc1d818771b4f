"""Inspection of a bag without a model: topics, stamps, excitation, and what the data can show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.metadata import condition_units, import_metadata, signal_units
from idloop.records.bags.read import read_streams, readable_topics
from idloop.records.bags.stream import JointStream
from idloop.records.bags.topics import (
    APPLIED_COMMAND,
    Topic,
    applied_command_findings,
    applied_command_topic,
    resolve_topic,
)
from idloop.records.finding import Finding
from idloop.records.inspection.axes import axes_of, once_per_stamp
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.clocks import StampStatistics, stamp_findings, stamp_statistics, while_measured
from idloop.records.inspection.coupled import transmission
from idloop.records.inspection.excitation import Excitation, analyse_command
from idloop.records.inspection.faults.checks import inspect_axis
from idloop.records.inspection.grade import grade
from idloop.records.inspection.insight import Evidence, insights, verdict
from idloop.records.inspection.motion import Motion, analyse_motion, beginning
from idloop.records.inspection.values import missing_values, runs, unusable_magnitude, without_bad_readings
from idloop.records.inspection.velocity_check import KIND as WRONG_VELOCITY
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.measured_conditions import ConditionSources
from idloop.spelling import listed

_COMMANDS = ("joint_command", "commands", "command")
# Topics that are neither the command nor a measurement; their values may be sent ahead of their time.
_ADDED = ("reference", "excitation", f"/{CONDITIONS}", APPLIED_COMMAND, "estimator/prediction", "estimator/residual")
_A_DAY = 86_400.0
_COASTS = 0.05  # of the largest speed: above, the axis moves


@dataclass(frozen=True)
class TopicReport:
    """One topic."""

    name: str
    type: str
    count: int  # messages
    readable: bool  # whether its numbers could be read
    stamped: bool  # whether its messages carry stamps of their own
    stamps: StampStatistics  # of the header stamps where there are any, else of the receive times
    receive: StampStatistics  # of the receive times
    # Receive time minus stamp, ``p50``, ``p99``, ``max`` [s]; empty where the clocks have nothing in common
    delay: dict[str, float]


@dataclass(frozen=True)
class ConditionReport:
    """Values of one measured condition."""

    unit: str  # empty where the bag does not say
    count: int  # values
    minimum: float
    maximum: float


@dataclass(frozen=True)
class JointReport:
    """One joint that moves."""

    command: str  # its command, ``joint.field``; "" where none was found
    # As those of the recording
    grade: str
    reason: str
    faults: tuple[str, ...]  # kinds of its faults


@dataclass(frozen=True)
class Inspection:
    """What `inspect_bag` found."""

    path: Path
    topics: tuple[TopicReport, ...]
    commands: dict[str, Excitation]  # by ``joint.field``
    signals: dict[str, dict[str, Motion]]  # measured signals: topic to ``joint.field`` to numbers
    units: dict[str, str]  # units by ``joint.field``, where the bag states them
    findings: tuple[Finding, ...]
    insights: tuple[str, ...]  # what this data can show, in sentences
    # ``usable``, ``short``, ``too_short``, ``contradictory``, ``several_runs``, ``not_excited``, ``no_command`` or
    # ``unreadable``
    verdict: str
    command_topic: str  # "" when none was found
    conditions: dict[str, ConditionReport] = field(default_factory=dict)  # conditions measured beside the axis, by name
    # Velocities that fits leave out, because they are not the derivatives of the recorded positions
    left_out: tuple[str, ...] = ()
    imported: dict[str, Any] = field(default_factory=dict)
    streams: dict[str, JointStream] = field(default_factory=dict, repr=False)  # the data itself, for plots
    # ``usable``, ``usable with care``, or ``not usable for`` what the faults spoil; and why
    grade: str = ""
    grade_reason: str = ""
    joints: dict[str, JointReport] = field(default_factory=dict)  # the joints that move
    axes: tuple[Axis, ...] = field(default=(), repr=False)  # the joints that move, for comparisons with other records

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings that lower the grade."""
        return tuple(one for one in self.findings if one.level == "warning")

    def with_notes(self, *kinds: str) -> Inspection:
        """Return the inspection with faults of these kinds as notes that spoil nothing."""
        findings = tuple(replace(one, level="note", spoils=()) if one.kind in kinds else one for one in self.findings)
        graded, reason = grade(self.verdict, findings)
        joints = {}
        for name, joint in self.joints.items():
            own = [one for one in findings if one.kind in joint.faults]
            faults = tuple(kind for kind in joint.faults if kind not in kinds)
            joints[name] = replace(_joint_report(name, self.axes, self.commands, own), faults=faults)
        return replace(self, findings=findings, grade=graded, grade_reason=reason, joints=joints)

    def to_dict(self) -> dict[str, object]:
        """Return plain values, schema ``idloop/inspect/1``."""

        def plain(found: Mapping[str, Any]) -> dict[str, Any]:
            return {name: asdict(one) for name, one in found.items()}

        own = ("verdict", "grade", "grade_reason", "left_out", "insights", "command_topic", "units", "imported")
        return {
            "schema": "idloop/inspect/1",
            "bag": str(self.path),
            **{key: list(value) if isinstance(value := getattr(self, key), tuple) else value for key in own},
            **{key: plain(getattr(self, key)) for key in ("joints", "commands", "conditions")},
            "signals": {topic: plain(motions) for topic, motions in self.signals.items()},
            **{key: [asdict(one) for one in getattr(self, key)] for key in ("topics", "faults", "findings")},
        }


def inspect_bag(
    path: Path | str,
    *,
    command: str | None = None,
    distro: str | None = None,
    definitions: Mapping[str, str] | None = None,
) -> Inspection:
    """Inspect a bag: rates, stamps, excitation, and what can be identified from it.

    `command`: topic of the command; by default ``joint_command``, or a topic that ends in ``commands``.
    `distro`: ROS distribution of message types that the bag does not define.
    `definitions`: of further message types; those of the ready mappings are known anyway.
    Raises InputError: bag missing, empty, damaged, or `command` not in it.
    """
    # Imported here: the validation of mapping files is slow to load.
    from idloop.records.tables.mapping import ready_definitions

    path = Path(path)
    with Bag(path, distro, ready_definitions() | dict(definitions or {})) as bag:
        streams = read_streams(bag)
        readable = set(readable_topics(bag))
        receive = bag.receive_stamps([topic for topic in bag.topics if topic not in streams])
        metadata, topics, unknown = bag.custom, bag.topics, bag.unknown_types
    requested = _command_topic(streams, topics, command, path)
    command_topic = applied_command_topic(requested, topics) if command is None and requested else requested
    sent = streams.get(command_topic)
    measured = {
        name: stream
        for name, stream in streams.items()
        if name not in (requested, command_topic) and not name.endswith(_ADDED)
    }
    units = signal_units(metadata)
    reports = []
    findings: list[Finding] = []
    for topic in topics.values():
        stream = streams.get(topic.name)
        received = receive[topic.name] if stream is None else stream.receive_ns
        stamps = received if stream is None else stream.stamp_ns
        if topic.name == command_topic:
            stamps = while_measured(stamps, [one.stamp_ns for one in measured.values()])
        report = TopicReport(
            name=topic.name,
            type=topic.type,
            count=int(received.size),
            readable=topic.name in readable,
            stamped=stream is not None and stream.stamped,
            stamps=stamp_statistics(stamps),
            receive=stamp_statistics(received),
            delay={} if stream is None else _delay(stream),
        )
        reports.append(report)
        findings += _topic_findings(report, stream, known=topic.type not in unknown, held=topic.name == command_topic)
    signals = {name: found for name, stream in measured.items() if (found := _motions(stream))}
    findings += [*_value_findings(signals), *_missing(measured, command=False)]
    findings += applied_command_findings(requested, command_topic)
    commands = {} if sent is None else _commands(sent)
    findings += [] if sent is None else _missing({command_topic: sent}, command=True)
    closed_loop = any(topic.rsplit("/", 1)[-1] == "reference" for topic in streams)
    axes = axes_of(
        measured,
        signals,
        sent,
        commands,
        units,
        start_ns=min((int(stream.stamp_ns.min()) for stream in streams.values()), default=0),
        has_reference=closed_loop,
        joined=len(import_metadata(metadata).get("files", ())) > 1,
    )
    own = {axis.joint: inspect_axis(axis) for axis in axes}
    findings += dict.fromkeys(one for found in own.values() for one in found)
    left_out = [one.where for one in findings if one.kind == WRONG_VELOCITY]
    motions = {name: motion for found in signals.values() for name, motion in found.items() if name not in left_out}
    evidence = _evidence(sent, commands, {topic: measured[topic] for topic in signals}, motions, units, closed_loop)
    ours = next((name for name in streams if name.endswith(f"/{CONDITIONS}")), "")
    answer = verdict(evidence)
    graded, reason = grade(answer, findings)
    conditions, _ = ConditionSources((), ours).read(streams, condition_units(metadata), 0, np.iinfo(np.int64).max)
    return Inspection(
        path=path,
        topics=tuple(reports),
        commands=commands,
        signals=signals,
        units=units,
        findings=tuple(findings),
        insights=tuple(insights(evidence)),
        verdict=answer,
        grade=graded,
        grade_reason=reason,
        joints={axis.joint: _joint_report(axis.joint, axes, commands, own[axis.joint]) for axis in axes},
        left_out=tuple(left_out),
        command_topic=command_topic,
        conditions={
            one.name: ConditionReport(one.unit, one.value.size, float(one.value.min()), float(one.value.max()))
            for one in conditions
        },
        imported=import_metadata(metadata),
        streams=streams,
        axes=tuple(replace(one, trusts_velocity=one.name("velocity") not in left_out) for one in axes),
    )


def _joint_report(
    joint: str, axes: Iterable[Axis], commands: Mapping[str, Excitation], findings: Iterable[Finding]
) -> JointReport:
    """Grade a joint by its findings; one without a command beside others can be fitted where one of them drives it."""
    by_name = {axis.joint: axis for axis in axes}
    own, answer = by_name[joint], "usable"
    if commands and not own.command_name:
        driving = [one.place for one in by_name.values() if one.command_name and one.place is not None]
        driven = own.place is not None and any(transmission(place, own.place) for place in driving)
        answer = "usable" if driven else "no_command"
    faults = tuple(one.kind for one in findings if one.level == "warning")
    return JointReport(own.command_name, *grade(answer, findings), faults)


def _command_topic(
    streams: Mapping[str, JointStream], topics: Mapping[str, Topic], named: str | None, path: Path
) -> str:
    if named is None:
        ending = {topic: topic.rsplit("/", 1)[-1] for topic in streams}
        return next((topic for name in _COMMANDS for topic in streams if ending[topic] == name), "")
    topic = resolve_topic(named, topics, path)
    if topic not in streams:
        raise InputError(f"{path}: {topic} carries no numbers that could be a command; readable are {listed(streams)}")
    return topic


def _topic_findings(report: TopicReport, stream: JointStream | None, *, known: bool, held: bool) -> list[Finding]:
    """Findings on one topic; `known` is whether its type is, `held` whether it is the command."""
    name = report.name
    if report.count == 0:
        return [Finding("no_messages", f"{name}: no message recorded", where=name)]
    found: list[Finding] = []
    if not known:
        text = f"{name}: the type {report.type} is unknown, its content was not read"
        found.append(Finding("unread_topic", text, report.count, name, "warning"))
    if stream is not None:
        found += stream.findings
        # A bridge and the conditions may pause: the last values then hold.
        if not name.endswith((f"/{APPLIED_COMMAND}", f"/{CONDITIONS}")):
            found += stamp_findings(name, report.stamps, announced=name.endswith(_ADDED), held=held)
    return found


def _delay(stream: JointStream) -> dict[str, float]:
    delay = (stream.receive_ns - stream.stamp_ns) * 1e-9
    # Else simulated time against the clock of the recorder.
    if not stream.stamped or abs(float(np.median(delay))) > _A_DAY:
        return {}
    p50, p99 = np.percentile(delay, [50, 99])
    return {"p50": float(p50), "p99": float(p99), "max": float(delay.max())}


def _motions(stream: JointStream) -> dict[str, Motion]:
    found = {name: analyse_motion(one, velocity=name.endswith(".velocity")) for name, one in stream.columns().items()}
    return {name: motion for name, motion in found.items() if motion is not None}


def _commands(stream: JointStream) -> dict[str, Excitation]:
    time, columns = once_per_stamp(stream)
    known = {name: np.isfinite(without_bad_readings(value)) for name, value in columns.items()}
    return {
        name: analyse_command(time[known[name]], value[known[name]])
        for name, value in columns.items()
        if known[name].any()
    }


def _value_findings(signals: Mapping[str, Mapping[str, Motion]]) -> list[Finding]:
    infinite, unusable = [], []
    for topic, name, one in [(topic, *item) for topic, motions in signals.items() for item in motions.items()]:
        if one.infinite:
            text = f"{topic} {name}: {one.infinite} infinite samples"
            infinite.append(Finding("infinite", text, one.infinite, topic, "warning"))
        if text := unusable_magnitude(name, one.minimum, one.maximum):
            unusable.append(Finding("magnitude", text, where=topic, level="warning"))
    return [*infinite, *unusable]


def _missing(streams: Mapping[str, JointStream], *, command: bool) -> list[Finding]:
    found = []
    for topic, stream in streams.items():
        columns = {name: column for name, column in stream.columns().items() if np.isfinite(column).any()}
        for name, column in columns.items():
            held = command and len(columns) == 1
            found += missing_values(f"{topic} {name}", stream.stamp_ns, column, topic, command=held)
    return found


def _evidence(
    command: JointStream | None,
    commands: Mapping[str, Excitation],
    measured: Mapping[str, JointStream],
    motions: Mapping[str, Motion],
    units: Mapping[str, str],
    closed_loop: bool,
) -> Evidence:
    # Of several driven joints the strongest command stands for the recording.
    name = max(commands, key=lambda key: commands[key].rms, default=None)
    stamps = [stamp_statistics(stream.stamp_ns) for stream in measured.values()]
    rates = [one.rate for one in stamps]
    if command is not None:
        stamps.append(stamp_statistics(command.stamp_ns))
    beginnings = (
        beginning(1e-9 * (stream.stamp_ns - stream.stamp_ns[0]), column, velocity=signal.endswith(".velocity"))
        for stream in measured.values()
        for signal, column in stream.columns().items()
        if signal in motions and signal.endswith((".position", ".velocity"))
    )
    return Evidence(
        command=commands[name] if name is not None else None,
        motions=motions,
        units=units,
        closed_loop=closed_loop,
        sample_rate=max(rates, default=float("nan")),
        coasting=_coasting(command, name, measured) if command is not None and name is not None else 0.0,
        runs=1 + max((len(one.resets) for one in stamps), default=0),
        from_rest=any(how == "from rest" for how, _ in beginnings),
    )


def _coasting(command: JointStream, name: str, measured: Mapping[str, JointStream]) -> float:
    """Return the longest time with zero command while some velocity is above 5 % of its largest value [s]."""
    value, longest = command.columns()[name], 0.0
    for stream in measured.values():
        stamp = stream.stamp_ns
        index = np.searchsorted(command.stamp_ns, stamp, side="right") - 1
        idle = (index >= 0) & (value[np.maximum(index, 0)] == 0)
        velocities = [one for signal, one in stream.columns().items() if signal.endswith(".velocity")]
        for speed in map(np.abs, velocities):
            coasts = runs(idle & (speed > _COASTS * np.nanmax(speed)))
            longest = max([longest, *(float(stamp[stop - 1] - stamp[start]) * 1e-9 for start, stop in coasts)])
    return longest
