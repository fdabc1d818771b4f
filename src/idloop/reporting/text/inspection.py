"""What is in a recording, in words: the verdict, the faults, then tables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from idloop.records.inspection.grade import what
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import listed

if TYPE_CHECKING:
    from idloop.records import Finding, Inspection

_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# Recordings above which those of one grade without a fault of their own have one line.
_MOST_LINES = 12


def _milli(seconds: float | None) -> str:
    return number(None if seconds is None else 1e3 * seconds, 3)


_JOINTS: dict[str, Callable[[str, Any], str]] = {
    "joint": lambda name, joint: name,
    "command": lambda name, joint: joint.command or "-",
    "grade": lambda name, joint: joint.grade,
    "faults": lambda name, joint: ", ".join(joint.faults) or "-",
}
_RECORDINGS: dict[str, Callable[[Inspection], str]] = {
    "recording": lambda one: one.path.name,
    "samples": lambda one: str(max((axis.time.size for axis in one.axes), default=0)),
    "s": lambda one: number(max((float(axis.time[-1] - axis.time[0]) for axis in one.axes), default=math.nan)),
    "period ms": lambda one: _milli(min((axis.period for axis in one.axes), default=None)),
    "joints": lambda one: ", ".join(one.joints) or "-",
    "grade": lambda one: one.grade,
    "reason": lambda one: one.grade_reason if len(one.grade_reason) < 60 else one.grade_reason[:57] + "...",
}
_TOPICS: dict[str, Callable[[Any], str]] = {
    "topic": lambda topic: topic.name,
    "type": lambda topic: topic.type,
    "messages": lambda topic: str(topic.count),
    "rate Hz": lambda topic: number(topic.stamps.rate),
    "period ms": lambda topic: _milli(topic.stamps.period),
    "jitter p50 ms": lambda topic: _milli(topic.stamps.jitter["p50"]),
    "p99 ms": lambda topic: _milli(topic.stamps.jitter["p99"]),
    "max ms": lambda topic: _milli(topic.stamps.jitter["max"]),
    "lost": lambda topic: str(topic.stamps.lost) if topic.stamps.regular else "-",
    "stamps": lambda topic: "header" if topic.stamped else "receive",
    "delay p99 ms": lambda topic: _milli(topic.delay.get("p99")),
}
_COMMANDS: dict[str, Callable[[str, Any], str]] = {
    "command": lambda name, one: name,
    "min": lambda name, one: number(one.minimum),
    "max": lambda name, one: number(one.maximum),
    "rms about mean": lambda name, one: number(one.rms),
    "crest": lambda name, one: number(one.crest_factor, 3),
    "levels": lambda name, one: "many" if one.levels > 64 else str(one.levels),
    "90 % band Hz": lambda name, one: f"{one.band_hz[0]:.3g} to {one.band_hz[1]:.3g}",
    "sign changes": lambda name, one: str(one.sign_changes),
    "at limits %": lambda name, one: number(100 * one.limit_share, 3),
    "zero %": lambda name, one: number(100 * one.zero_share, 3),
}
_MEASURED: dict[str, Callable[[str, str, Any], str]] = {
    "measured": lambda name, topic, one: name,
    "topic": lambda name, topic, one: topic,
    "min": lambda name, topic, one: number(one.minimum),
    "max": lambda name, topic, one: number(one.maximum),
    "step": lambda name, topic, one: number(one.resolution, 3),
    "moves": lambda name, topic, one: "yes" if one.moves else "no",
    "reversals": lambda name, topic, one: str(one.reversals),
}
_CONDITIONS: dict[str, Callable[[str, Any], str]] = {
    "condition": lambda name, one: f"{name} [{one.unit or '?'}]",
    "values": lambda name, one: str(one.count),
    "min": lambda name, one: number(one.minimum),
    "max": lambda name, one: number(one.maximum),
}


def inspection_blocks(inspection: Inspection) -> Iterator[Block]:
    """Yield the verdict, the faults, the tables and what the data can show."""
    yield f"Verdict: {_graded(inspection)}: {inspection.grade_reason}"
    yield from _lines(inspection.faults)
    yield from _lines([one for one in inspection.findings if one.level != "warning"])
    if len(inspection.joints) > 1:
        yield ""
        yield Table.by_column(_JOINTS, inspection.joints.items())
    yield ""
    yield Table.by_column(_TOPICS, zip(inspection.topics, strict=True))
    commands = [(_with_unit(name, inspection), one) for name, one in inspection.commands.items()]
    measured = [
        (_with_unit(name, inspection), topic, one)
        for topic, found in inspection.signals.items()
        for name, one in found.items()
    ]
    tables: tuple[tuple[Mapping[str, Callable[..., str]], Iterable[tuple[Any, ...]]], ...] = (
        (_COMMANDS, commands),
        (_MEASURED, measured),
        (_CONDITIONS, inspection.conditions.items()),
    )
    for columns, items in tables:
        if items:
            yield ""
            yield Table.by_column(columns, items)
    if inspection.insights:
        yield ""
    for sentence in inspection.insights:
        yield f"- {sentence}"


def comparison_blocks(inspections: Sequence[Inspection], between: Sequence[Finding]) -> Iterator[Block]:
    """Yield a row for each recording, then the faults between them, then those of each."""
    yield Table.by_column(_RECORDINGS, zip(inspections, strict=True))
    yield ""
    yield from _lines(between) if between else ["No fault between the recordings: joints, units, sample times, gains."]
    if faulty := [one for one in inspections if one.faults]:
        yield ""
        yield from recording_lines(faulty, len(inspections))


def recording_lines(inspections: Sequence[Inspection], count: int = 0) -> Iterator[str]:
    """Yield the grade of each recording with its own faults, then the faults that several have, each once.

    The reason for a grade follows it where no fault says it. Of many recordings, those without a fault of their own
    have one line for each grade. `count` is that of all recordings, where some are left out.
    """
    having: dict[tuple[str, ...], list[tuple[str, Finding]]] = {}
    for one in inspections:
        for fault in one.faults:
            having.setdefault(_alike(fault), []).append((one.path.name, fault))
    plain: dict[str, list[str]] = {}
    for one in inspections:
        known = any(what(fault) in one.grade_reason for fault in one.faults)
        grade = f"{_graded(one)}{'' if known else f': {one.grade_reason}'}"
        own = [fault for fault in one.faults if len(having[_alike(fault)]) == 1]
        if len(inspections) > _MOST_LINES and not own:
            plain.setdefault(grade, []).append(one.path.name)
            continue
        yield f"{one.path.name}: {grade}"
        yield from _lines(own)
    yield from (f"{listed(names, 6)}: {grade}" for grade, names in plain.items())
    for those in having.values():
        if len(those) == 1:
            continue
        names = list(dict.fromkeys(name for name, _ in those))
        name, worst = max(those, key=lambda one: one[1].count)
        every = count or len(inspections)
        part = f"{len(names)} of {every} records ({listed(names, 6)})"
        where = f"all {every} records" if len(names) == every else part
        yield from _lines([worst], f" in {where}, here {name}")


def _alike(fault: Finding) -> tuple[str, ...]:
    """What faults of several recordings have in common that are said once: all but their numbers."""
    return fault.level, fault.kind, fault.where, _NUMBER.sub("", fault.cure)


def between_lines(between: Sequence[Finding]) -> Iterator[str]:
    """Yield the faults between recordings; nothing where there are none."""
    yield from _lines(between)


def _graded(inspection: Inspection) -> str:
    """The grade, and which signals fits leave out."""
    without = f", without {' and '.join(inspection.left_out)}" if inspection.left_out else ""
    return f"{inspection.grade}{without}"


def _lines(findings: Sequence[Finding], where: str = "") -> Iterator[str]:
    for finding in findings:
        more = "" if finding.cure in finding.text else f"; {finding.cure}"
        yield f"{finding.level}{where}: {finding.text}{more}"


def _with_unit(name: str, inspection: Inspection) -> str:
    unit = inspection.units.get(name)
    return f"{name} [{unit}]" if unit else name
