"""A fleet in words and rows: what was done, the kinds, what differs, what has changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from datetime import date, timedelta
from typing import Any

import numpy as np

from idloop.estimation.statistics.interval_text import interval_text
from idloop.fleet.alarms import REFERENCE
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import FEWEST_UNITS, Components, Finding
from idloop.p_values import p_value_text
from idloop.reporting.text.blocks import Block, Table, number

FINDING_COLUMNS = {
    "what": "string", "kind": "string", "parameter": "string", "unit": "string", "robot": "string", "joint": "string",
    "day": "string", "size": "double", "low": "double", "high": "double", "p_value": "double", "q_value": "double",
}  # fmt: skip
UNIT_COLUMNS = {
    "robot": "string", "joint": "string", "kind": "string", "parameter": "string", "unit": "string", "level": "double",
    "stderr": "double", "shrunk": "double", "kind_mean": "double", "unit_deviation": "double",
    "day_deviation": "double",
}  # fmt: skip
_Z95 = 1.959963984540054
_MOST = 20  # findings and failures in the text
_WHAT = {
    "odd": "differs from its kind", "trend": "changes steadily", "step": "changes at once", "day": "single recording",
    "period": "since the date", "beyond": "since the date, beyond its kind", "alarm": "has grown since",
}  # fmt: skip


def day_text(day: float) -> str:
    """Date of a day counted from 1970."""
    return str(date(1970, 1, 1) + timedelta(days=int(day)))


def finding_row(found: Finding) -> dict[str, Any]:
    """Row of a finding."""
    return {**asdict(found), "day": day_text(found.day)}


def component_row(parts: Components) -> dict[str, Any]:
    """Row of a parameter of a kind; of the force error in its logarithm."""
    series = parts.series
    error = np.sqrt(np.nanmedian(series.variance))
    return {
        "kind": series.kind, "parameter": series.parameter, "unit": series.unit, "units": len(series.names),
        "recordings": int(np.isfinite(series.value).sum()), "mean": parts.mean,
        "unit_deviation": parts.unit_deviation, "date_deviation": float(np.std(parts.date)),
        "day_deviation": parts.day_deviation, "error": float(error), "memory": parts.memory,
    }  # fmt: skip


def unit_rows(components: Iterable[Components]) -> Iterator[dict[str, Any]]:
    """Yield a row for each parameter of each unit."""
    for parts in components:
        series = parts.series
        for place, (robot, joint) in enumerate(series.names):
            yield {
                "robot": robot, "joint": joint, "kind": series.kind, "parameter": series.parameter,
                "unit": series.unit, "level": float(parts.level[place]), "stderr": float(parts.level_stderr[place]),
                "shrunk": float(parts.shrunk[place]), "kind_mean": parts.mean,
                "unit_deviation": parts.unit_deviation, "day_deviation": parts.day_deviation,
            }  # fmt: skip


def fleet_blocks(document: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the parts of the summary of a document of schema ``idloop/fleet/1``."""
    yield headline(document)
    yield read_words(document["new"], document["bags"])
    if document["kinds"]:
        yield from _compared(document)
    for one in document["diagnoses"]:
        yield ""
        yield f"{one['robot']} {one['joint']}: {one['conclusion']}"
        if one["report"]:
            yield f"  report: {document['folder']}/{one['report']}"
    if document["failed"]:
        yield ""
        yield "not identified"
        yield from _first(failed_table(document), "rows", "fleet.json")


def _compared(document: Mapping[str, Any]) -> Iterator[Block]:
    yield ""
    yield "mean over the joints of a kind; standard deviations of joints, dates, single days, and of the error of a fit"
    yield kind_table(document)
    yield ""
    yield findings_words(document)
    yield from _first(finding_table(document["findings"]), "findings", "findings.parquet")
    if document["since"]:
        yield ""
        yield periods_words(document)
        yield from _first(finding_table(document["periods"]), "changes", "fleet.json")
    yield ""
    yield alarms_words(document)
    yield from _first(finding_table(document["alarms"]), "alarms", "fleet.json")
    yield from (f"{one}: recordings scatter too much for an alarm" for one in document["unwatched"])


def headline(document: Mapping[str, Any]) -> str:
    """What was found, in one line."""
    if not document["kinds"]:
        return "nothing was identified"
    units = {(one["robot"], one["joint"]) for one in document["findings"] if one["robot"] and one["what"] != "day"}
    kinds = {one["kind"] for one in document["findings"] if not one["robot"]}
    days = sum(one["what"] == "day" for one in document["findings"])
    failed = len(document["failed"])
    parts = [
        _counted(len(units), "joint differs or changes", "joints differ or change"),
        _counted(len(kinds), "kind changes as a whole", "kinds change as a whole"),
        _counted(
            days, "single recording is off the course of its joint", "single recordings are off their joint's course"
        ),
        "" if document["findings"] else "nothing differs or changes",
        _counted(failed, "recording or joint could not be identified", "recordings or joints could not be identified"),
    ]
    found = "; ".join(filter(None, parts))
    most: dict[str, int] = {}
    for one in document["kinds"]:
        most[one["kind"]] = max(most.get(one["kind"], 0), one["units"])
    joints = _counted(sum(most.values()), "joint", "joints")
    return f"{joints} in {_counted(document['bags'], 'recording', 'recordings')}: {found}"


def read_words(new: int, bags: int) -> str:
    """How many recordings were read now, and how many are known from before."""
    if not new:
        return f"no recording is new; {bags} {'was' if bags == 1 else 'were'} read before"
    now = f"{_counted(new, 'recording was', 'recordings were')} read"
    return f"{now} now, {bags - new} before" if new < bags else now


def findings_words(document: Mapping[str, Any]) -> str:
    """What the findings are taken from."""
    tests = _counted(document["tests"], "test", "tests")
    if not tests:
        return "no test yet: a change takes four recordings of a joint, a joint that differs four others of its kind"
    if not document["findings"]:
        return f"{tests}, no finding"
    return f"{tests}; of what is listed at most {100.0 * document['level']:g} % is false on average"


def periods_words(document: Mapping[str, Any]) -> str:
    """Which periods are compared, if there is something to compare."""
    since, against = document["since"], document["against"]
    before = f"the days from {against} on" if against else "the days before"
    if not document["periods"]:
        return f"nothing to compare since {since} with {before}: no joint has recordings in both"
    return f"change since {since} against {before}: kinds first, then the joints that the same rate leaves"


def alarms_words(document: Mapping[str, Any]) -> str:
    """What an alarm means, or that there is none."""
    if not document["alarms"]:
        return f"no alarm of wear; there may be one from recording {REFERENCE + 1} of a joint on"
    return f"alarms of wear; one false alarm in {document['recordings_per_false_alarm']} recordings of a joint"


def _counted(count: int, one: str, several: str) -> str:
    """Count with the words for it; empty for none."""
    return f"{count} {one if count == 1 else several}" if count else ""


def kind_table(document: Mapping[str, Any]) -> Table:
    """Table of the kinds: mean, and what belongs to unit, date, day and error."""
    rows = []
    for one in document["kinds"]:
        log = one["parameter"] == FORCE_ERROR
        mean = f"{100.0 * np.exp(one['mean']):.3g} %" if log else number(one["mean"])
        parts = ("unit_deviation", "date_deviation", "day_deviation", "error")
        size = 1.0 if log else abs(one["mean"]) or 1.0
        # What too few joints share is not known.
        known = (one["units"] > 1, one["units"] >= FEWEST_UNITS, one["recordings"] > one["units"], not log)
        shares = [f"{100.0 * one[key] / size:.2g} %" if sure else "-" for key, sure in zip(parts, known, strict=True)]
        rows.append((one["kind"], one["parameter"], str(one["units"]), mean, one["unit"].strip("1"), *shares))
    return Table.of(("kind", "parameter", "joints", "mean", "unit", "joints ±", "dates ±", "days ±", "error ±"), rows)


def finding_table(findings: Iterable[Mapping[str, Any]]) -> Table:
    """Table of findings."""
    rows = []
    for one in findings:
        share = one["parameter"] == FORCE_ERROR
        size, low, high = (100.0 * one[key] if share else one[key] for key in ("size", "low", "high"))
        rows.append((
            one["robot"] or f"all of {one['kind']}", one["joint"] or "-", one["parameter"], _WHAT[one["what"]],
            one["day"], f"{size:+.3g}", interval_text(low, high), "%" if share else one["unit"],
            p_value_text(one["p_value"]),
        ))  # fmt: skip
    return Table.of(("robot", "joint", "parameter", "finding", "date", "by", "95 % interval", "unit", "p"), rows)


def level_table(components: Iterable[Components]) -> Table:
    """Table of the levels of every joint beside those of its kind; of the force error as percentages."""
    rows = []
    for one in unit_rows(components):
        share = one["parameter"] == FORCE_ERROR
        ends = np.array(
            [one["level"], one["shrunk"], one["kind_mean"], *(one["level"] + np.array([-_Z95, _Z95]) * one["stderr"])]
        )
        level, shrunk, mean, low, high = (100.0 * np.exp(ends) if share else ends).tolist()
        apart = one["level"] - one["kind_mean"]
        away = f"{apart / one['unit_deviation']:+.1f} σ" if one["unit_deviation"] else "-"
        rows.append((
            one["robot"], one["joint"], one["parameter"], number(level), interval_text(low, high), number(shrunk),
            number(mean), "%" if share else one["unit"], away,
        ))  # fmt: skip
    head = (
        "robot",
        "joint",
        "parameter",
        "level",
        "95 % interval",
        "shrunk to its kind",
        "kind",
        "unit",
        "from its kind",
    )
    return Table.of(head, rows)


def failed_table(document: Mapping[str, Any]) -> Table:
    """Table of what could not be identified."""
    rows = [
        (one["robot"], one["joint"] or "-", str(one["time"] or "-")[:10], one["bag"], _reason(one))
        for one in document["failed"]
    ]
    return Table.of(("robot", "joint", "date", "bag", "reason"), rows)


def _reason(one: Mapping[str, Any]) -> str:
    """Reason without the name of the bag, which stands beside it."""
    reason: str = one["reason"]
    return reason.partition(": ")[2] if reason.startswith(one["bag"]) else reason


def _first(table: Table, what: str, file: str) -> Iterator[Block]:
    if table.rows:
        yield Table(table.header, table.rows[:_MOST])
    if len(table.rows) > _MOST:
        yield f"and {len(table.rows) - _MOST} more {what}: {file}"
