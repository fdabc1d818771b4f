"""What is in a recording, in words: the verdict, the faults, then tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from idloop.records.inspection.grade import what
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import listed

if TYPE_CHECKING:
    from idloop.records import Finding, Inspection

_TOPICS = (
    "topic",
    "type",
    "messages",
    "rate Hz",
    "period ms",
    "jitter p50 ms",
    "p99 ms",
    "max ms",
    "lost",
    "stamps",
    "delay p99 ms",
)
_COMMANDS = (
    "command",
    "min",
    "max",
    "rms about mean",
    "crest",
    "levels",
    "90 % band Hz",
    "sign changes",
    "at limits %",
    "zero %",
)
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_MEASURED = ("measured", "topic", "min", "max", "step", "moves", "reversals")


def inspection_blocks(inspection: Inspection) -> Iterator[Block]:
    """Yield the verdict, the faults, the tables and what the data can show."""
    yield f"Verdict: {_graded(inspection)}: {inspection.grade_reason}"
    yield from _lines(inspection.faults)
    yield from _lines([one for one in inspection.findings if one.level != "warning"])
    if len(inspection.joints) > 1:
        yield ""
        yield Table.of(
            ["joint", "command", "grade", "faults"],
            [
                (name, joint.command or "-", joint.grade, ", ".join(joint.faults) or "-")
                for name, joint in inspection.joints.items()
            ],
        )
    yield from _tables(inspection)
    if inspection.insights:
        yield ""
    for sentence in inspection.insights:
        yield f"- {sentence}"


def comparison_blocks(inspections: Sequence[Inspection], between: Sequence[Finding]) -> Iterator[Block]:
    """Yield a row for each recording, then the faults between them, then those of each."""
    yield Table.of(
        ["recording", "samples", "s", "period ms", "joints", "grade", "reason"],
        [
            (
                one.path.name,
                str(max((axis.time.size for axis in one.axes), default=0)),
                number(max((float(axis.time[-1] - axis.time[0]) for axis in one.axes), default=float("nan"))),
                _milli(min((axis.period for axis in one.axes), default=None)),
                ", ".join(one.joints) or "-",
                one.grade,
                one.grade_reason if len(one.grade_reason) < 60 else one.grade_reason[:57] + "...",
            )
            for one in inspections
        ],
    )
    yield ""
    yield from _lines(between) if between else ["No fault between the recordings: joints, units, sample times, gains."]
    if faulty := [one for one in inspections if one.faults]:
        yield ""
        yield from recording_lines(faulty, len(inspections))


def recording_lines(inspections: Sequence[Inspection], count: int = 0) -> Iterator[str]:
    """Yield the grade of each recording with its own faults, then the faults that several have, each once.

    The reason for a grade follows it where no fault says it. `count` is that of all recordings, where some are left
    out.
    """
    having: dict[tuple[str, ...], list[tuple[str, Finding]]] = {}
    for one in inspections:
        for fault in one.faults:
            having.setdefault(_alike(fault), []).append((one.path.name, fault))
    for one in inspections:
        known = any(what(fault) in one.grade_reason for fault in one.faults)
        yield f"{one.path.name}: {_graded(one)}{'' if known else f': {one.grade_reason}'}"
        yield from _lines([fault for fault in one.faults if len(having[_alike(fault)]) == 1])
    for those in having.values():
        if len(those) == 1:
            continue
        names = list(dict.fromkeys(name for name, _ in those))
        name, worst = max(those, key=lambda one: one[1].count)
        every = count or len(inspections)
        where = (
            f"all {every} records" if len(names) == every else f"{len(names)} of {every} records ({listed(names, 6)})"
        )
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


def _tables(inspection: Inspection) -> Iterator[Block]:
    yield ""
    yield Table.of(
        _TOPICS,
        [
            (
                topic.name,
                topic.type,
                str(topic.count),
                number(topic.stamps.rate),
                _milli(topic.stamps.period),
                _milli(topic.stamps.jitter["p50"]),
                _milli(topic.stamps.jitter["p99"]),
                _milli(topic.stamps.jitter["max"]),
                str(topic.stamps.lost) if topic.stamps.regular else "-",
                "header" if topic.stamped else "receive",
                _milli(topic.delay.get("p99")),
            )
            for topic in inspection.topics
        ],
    )
    if inspection.commands:
        yield ""
        yield Table.of(
            _COMMANDS,
            [
                (
                    _with_unit(name, inspection),
                    number(item.minimum),
                    number(item.maximum),
                    number(item.rms),
                    number(item.crest_factor, 3),
                    "many" if item.levels > 64 else str(item.levels),
                    f"{item.band_hz[0]:.3g} to {item.band_hz[1]:.3g}",
                    str(item.sign_changes),
                    number(100 * item.limit_share, 3),
                    number(100 * item.zero_share, 3),
                )
                for name, item in inspection.commands.items()
            ],
        )
    rows = [
        (
            _with_unit(name, inspection),
            topic,
            number(item.minimum),
            number(item.maximum),
            number(item.resolution, 3),
            "yes" if item.moves else "no",
            str(item.reversals),
        )
        for topic, found in inspection.signals.items()
        for name, item in found.items()
    ]
    if rows:
        yield ""
        yield Table.of(_MEASURED, rows)
    if inspection.conditions:
        yield ""
        yield Table.of(
            ["condition", "values", "min", "max"],
            [
                (f"{name} [{one.unit or '?'}]", str(one.count), number(one.minimum), number(one.maximum))
                for name, one in inspection.conditions.items()
            ],
        )


def _milli(seconds: float | None) -> str:
    return number(None if seconds is None else 1e3 * seconds, 3)


def _with_unit(name: str, inspection: Inspection) -> str:
    unit = inspection.units.get(name)
    return f"{name} [{unit}]" if unit else name
