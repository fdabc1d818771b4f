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
from idloop.fleet.statistics import FEWEST_DAYS, FEWEST_UNITS, RELATIVE, Components, Finding
from idloop.p_values import p_value_text
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import listed
from idloop.validation.measures import HALF_OF_POWER

_MADE_BY = {"settings": "string", "version": "string", "seed": "int64"}
FINDING_COLUMNS = {
    "what": "string", "kind": "string", "parameter": "string", "unit": "string", "robot": "string", "joint": "string",
    "day": "string", "size": "double", "low": "double", "high": "double", "p_value": "double", "q_value": "double",
    **_MADE_BY,
}  # fmt: skip
UNIT_COLUMNS = {
    "robot": "string", "joint": "string", "kind": "string", "parameter": "string", "unit": "string", "level": "double",
    "stderr": "double", "low": "double", "high": "double", "shrunk": "double", "kind_mean": "double",
    "unit_deviation": "double", "day_deviation": "double", "from_kind": "double", **_MADE_BY,
}  # fmt: skip
KIND_WORDS = (
    "mean over the joints of a kind, of the force error the geometric one; ± σ: one standard deviation of joints, of "
    "dates that all joints share, of single days, and of the error of a fit, as a share of the mean; joints that are "
    "too far off to be of one normal distribution with the others are left out of mean, deviation and bands (4 of 5: "
    "one is); -: too few joints or recordings, or no error is stated"
)
FINDING_WORDS = (
    "odd: the joint beside the mean of its kind, date: its first recording outside of the range of 95 % of its kind; "
    "trend: change from the first recording to the last one, date: the last one; step: change at the date; day: the "
    "recording of the date beside the course of its joint"
)
LEVEL_WORDS = (
    "level: mean of the joint over its recordings, weighted by their variances, without what its kind shares on each "
    "date; of the force error the geometric one"
)
_DIGITS = 3  # of the ends of intervals, or more where they need them
_WHOLE = 0.995  # share from which on two digits do not reach the decimal point
_FOUND = "five to eight"  # counted on simulated fleets
_MOST = 20  # findings and failures in the text
_WHAT = {
    "odd": "odd: differs from its kind since", "trend": "trend: changes steadily", "step": "step: changes at once",
    "day": "day: single recording", "period": "since the date", "beyond": "since the date, beyond its kind",
    "alarm": "alarm: has grown since",
}  # fmt: skip


def day_text(day: float) -> str:
    """Date of a day counted from 1970."""
    return str(date(1970, 1, 1) + timedelta(days=int(day)))


def finding_row(found: Finding) -> dict[str, Any]:
    """Row of a finding."""
    return {**asdict(found), "day": day_text(found.day)}


def component_row(parts: Components) -> dict[str, Any]:
    """Row of a parameter of a kind, in the unit of the parameter."""
    series = parts.series
    slope = float(series.slope(parts.mean))
    error = np.sqrt(np.nanmedian(series.variance))
    return {
        "kind": series.kind, "parameter": series.parameter, "unit": series.unit, "units": len(series.names),
        "kept": int(parts.kept.sum()), "recordings": int(np.isfinite(series.value).sum()),
        "followed": int(np.sum(np.isfinite(series.value).sum(axis=1) >= FEWEST_DAYS)),
        "mean": float(series.natural(parts.mean)), "unit_deviation": slope * parts.unit_deviation,
        "date_deviation": slope * float(np.std(parts.date)),
        "day_deviation": slope * parts.day_deviation, "error": slope * float(error), "memory": parts.memory,
    }  # fmt: skip


def unit_rows(components: Iterable[Components]) -> Iterator[dict[str, Any]]:
    """Yield a row for each parameter of each unit, in the unit of the parameter.

    Only the distance from the kind is in standard deviations, of units and of the error of the level.
    """
    for parts in components:
        series = parts.series
        mean, slope = float(series.natural(parts.mean)), float(series.slope(parts.mean))
        level, shrunk = series.natural(parts.level), series.natural(parts.shrunk)
        stderr = series.slope(parts.level) * parts.level_stderr
        low, high = series.natural_interval(parts.level, parts.level_stderr, parts.freedom)
        away = (parts.level - parts.mean) / np.maximum(np.hypot(parts.unit_deviation, parts.level_stderr), 1e-300)
        for place, (robot, joint) in enumerate(series.names):
            yield {
                "robot": robot, "joint": joint, "kind": series.kind, "parameter": series.parameter,
                "unit": series.unit, "level": float(level[place]), "stderr": float(stderr[place]),
                "low": float(low[place]), "high": float(high[place]), "shrunk": float(shrunk[place]),
                "kind_mean": mean,
                "unit_deviation": slope * parts.unit_deviation, "day_deviation": slope * parts.day_deviation,
                "from_kind": float(away[place]),
            }  # fmt: skip


def misfits(parts: Components) -> dict[tuple[str, str], float]:
    """Force error of the joints of which the model explains less than half of the power of the drive force."""
    if parts.series.parameter != FORCE_ERROR:
        return {}
    error = parts.series.natural(parts.level).tolist()
    return {name: one for name, one in zip(parts.series.names, error, strict=True) if one > HALF_OF_POWER}


def misfit_rows(components: Iterable[Components]) -> Iterator[dict[str, Any]]:
    """Yield a row for each kind of which the model fits some joints badly."""
    for parts in components:
        if error := misfits(parts):
            yield {
                "kind": parts.series.kind, "joints": len(error), "of": len(parts.series.names),
                "force_error": max(error.values()),
            }  # fmt: skip


def misfit_text(error: float) -> str:
    """What is wrong with a joint that the model fits badly."""
    return (
        f"the model fits this joint badly: it explains less than half of the power of the drive force, and the force "
        f"error is {100.0 * error:.3g} %; do not trust the values below"
    )


def diagnosis_words(document: Mapping[str, Any]) -> str:
    """What a diagnosis is, and how often it errs."""
    level, count = document["diagnosis_level"], len(document["diagnoses"])
    return (
        f"diagnosis of the newest recording of {_counted(count, 'joint', 'joints')}, each by itself: where nothing is "
        f"missing, an effect is added with a probability of {100.0 * level:g} %, which is {level * count:.2g} of "
        f"{count} on average"
    )


def misfit_words(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with a model that fits joints badly, and what to do."""
    kinds = [one["kind"] for one in document["kinds"]]
    for one in document["misfits"]:
        joints = f"{one['joints']} of {_counted(one['of'], 'joint', 'joints')}"
        yield (
            f"{kind_text(one['kind'], kinds)}: the model fits {joints} badly: it explains less than half of the power "
            f"of the drive force, and the force error is up to {100.0 * one['force_error']:.3g} %; do not trust the "
            "values below; --diagnose looks for what the model lacks"
        )


def untested_words(document: Mapping[str, Any]) -> list[str]:
    """What could not be tested, of which kinds, and why."""
    kinds: dict[str, dict[str, Any]] = {}
    for one in document["kinds"]:
        best = kinds.setdefault(one["kind"], {"units": 0, "followed": 0})
        kinds[one["kind"]] = {key: max(best[key], one[key]) for key in best}
    few = {
        f"whether a joint differs from its kind, which takes {FEWEST_UNITS} joints of a kind": [
            kind for kind, one in kinds.items() if one["units"] < FEWEST_UNITS
        ],
        f"whether a joint changes, which takes {FEWEST_DAYS} recordings of it at least": [
            kind for kind, one in kinds.items() if not one["followed"]
        ],
    }
    several = len(kinds) > 1
    return [
        f"not tested{' for ' + listed([kind_text(one, kinds) for one in which]) if several else ''}: {what}"
        for what, which in few.items() if which
    ]  # fmt: skip


def fleet_blocks(document: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the parts of the summary of a document of schema ``idloop/fleet/1``."""
    yield headline(document)
    yield read_words(document["new"], document["bags"])
    yield from (f"warning: {one}" for one in misfit_words(document))
    if document["kinds"]:
        yield from _compared(document)
    if document["diagnoses"]:
        yield ""
        yield diagnosis_words(document)
    for one in document["diagnoses"]:
        yield ""
        yield f"{one['robot']} {one['joint']}: {one['conclusion']}"
        if one["report"]:
            yield f"  report: {document['folder']}/{one['report']}"
    if document["failed"]:
        yield ""
        yield "not identified"
        yield from _first(failed_table(document), "reasons", "fleet.json")


def _compared(document: Mapping[str, Any]) -> Iterator[Block]:
    yield ""
    yield KIND_WORDS
    yield kind_table(document)
    yield ""
    yield findings_words(document)
    if document["findings"]:
        yield FINDING_WORDS
    yield from _first(finding_table(document, "findings"), "findings", "findings.parquet")
    if document["since"]:
        yield ""
        yield periods_words(document)
        yield from _first(finding_table(document, "periods"), "changes", "fleet.json")
    yield ""
    yield alarms_words(document)
    yield from _first(finding_table(document, "alarms"), "alarms", "fleet.json")
    yield from (f"{one}: recordings scatter too much for an alarm" for one in document["unwatched"])


def headline(document: Mapping[str, Any]) -> str:
    """What was found, in one line."""
    if not document["kinds"]:
        return "nothing was identified"
    units = {(one["robot"], one["joint"]) for one in document["findings"] if one["robot"] and one["what"] != "day"}
    kinds = {one["kind"] for one in document["findings"] if not one["robot"]}
    days = sum(one["what"] == "day" for one in document["findings"])
    since = [one for one in document["periods"] if one["q_value"] <= document["level"]]
    later, later_kinds = (
        {(one["robot"], one["joint"]) for one in since if one["robot"]},
        {one["kind"] for one in since if not one["robot"]},
    )
    date, failed = document["since"], len(document["failed"])
    misfits, untested = sum(one["joints"] for one in document["misfits"]), untested_words(document)
    parts = [
        _counted(misfits, "joint is fitted badly by the model", "joints are fitted badly by the model"),
        _counted(len(units), "joint differs or changes", "joints differ or change"),
        _counted(len(kinds), "kind changes as a whole", "kinds change as a whole"),
        _counted(
            days, "single recording is off the course of its joint", "single recordings are off their joint's course"
        ),
        _counted(len(later), f"joint has changed since {date}", f"joints have changed since {date}"),
        _counted(
            len(later_kinds), f"kind has changed as a whole since {date}", f"kinds have changed as a whole since {date}"
        ),
        "" if document["findings"] or since else f"nothing {'that was tested ' if untested else ''}differs or changes",
        *untested,
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
        return (
            f"no test yet: a change takes {FEWEST_DAYS} recordings of a joint at least, a joint that differs "
            f"{FEWEST_UNITS - 1} others of its kind"
        )
    if not document["findings"]:
        return f"{tests}, no finding; most changes are found from {_FOUND} recordings after them on"
    return f"{tests}; of what is listed at most {100.0 * document['level']:g} % is false on average"


def periods_words(document: Mapping[str, Any]) -> str:
    """Which periods are compared, if there is something to compare."""
    since, against = document["since"], document["against"]
    before = f"the days from {against} on" if against else "the days before"
    beyond = "that of a joint among five or more is what it has beyond the mean change of its kind"
    if not document["periods"]:
        return f"nothing to compare since {since} with {before}: no joint has recordings in both"
    rate = f"at most {100.0 * document['level']:g} % of the joints are listed falsely on average"
    return (
        f"change since {since} against {before}: of each kind as a whole, significant or not; then of the joints whose "
        f"change is significant, {rate}; {beyond}"
    )


def alarms_words(document: Mapping[str, Any]) -> str:
    """What an alarm means, or that there is none."""
    if not document["alarms"]:
        return f"no alarm of wear; there may be one from recording {REFERENCE + 1} of a joint on"
    return (
        f"alarms of wear, each of the growth since its date over the first {REFERENCE} recordings; one false alarm in "
        f"{document['recordings_per_false_alarm']} recordings of a joint"
    )


def _counted(count: int, one: str, several: str) -> str:
    """Count with the words for it; empty for none."""
    return f"{count} {one if count == 1 else several}" if count else ""


def kind_text(kind: str, kinds: Iterable[str]) -> str:
    """Words for a kind among others: the pattern of all joints is no name."""
    if kind != "*":
        return kind
    return "other joints" if len(set(kinds)) > 1 else "all joints"


def display(parameter: str, unit: str) -> tuple[float, str]:
    """Factor and unit with which a parameter is shown: an error of the force in percent."""
    return (100.0, "% of drive force") if parameter == FORCE_ERROR else (1.0, unit)


def kind_table(document: Mapping[str, Any]) -> Table:
    """Table of the kinds: mean, and what belongs to unit, date, day and error."""
    rows = []
    kinds = [one["kind"] for one in document["kinds"]]
    for one in document["kinds"]:
        factor, unit = display(one["parameter"], one["unit"].strip("1"))
        parts = ("unit_deviation", "date_deviation", "day_deviation", "error")
        size = abs(one["mean"]) or 1.0
        # What too few joints or recordings have, and an error that no fit states.
        known = (one["units"] > 1, one["units"] >= FEWEST_UNITS, one["recordings"] > one["units"], one["error"] > 0.0)
        shares = [_percent(one[key] / size) if sure else "-" for key, sure in zip(parts, known, strict=True)]
        joints = str(one["units"]) if one["kept"] == one["units"] else f"{one['kept']} of {one['units']}"
        head = (kind_text(one["kind"], kinds), one["parameter"], joints, number(factor * one["mean"]), unit)
        rows.append((*head, *shares))
    deviations = ("joints ± σ", "dates ± σ", "days ± σ", "error ± σ")
    return Table.of(("kind", "parameter", "joints", "mean", "unit", *deviations), rows)


def _percent(share: float) -> str:
    """Two digits, or all before the decimal point."""
    return f"{100.0 * share:.0f} %" if share >= _WHOLE else f"{100.0 * share:.2g} %"


def finding_table(document: Mapping[str, Any], which: str) -> Table:
    """Table of the findings that the document has under a name."""
    rows = []
    kinds = [one["kind"] for one in document["kinds"]]
    for one in document[which]:
        # As a factor: beside an error that is itself in percent, percent of it would be taken for that.
        relative = one["unit"] == RELATIVE
        size, low, high = (1.0 + one[key] if relative else one[key] for key in ("size", "low", "high"))
        whole = kind_text(one["kind"], kinds)
        rows.append((
            one["robot"] or (f"all of {whole}" if whole == one["kind"] else whole), one["joint"] or "-",
            one["parameter"], _WHAT[one["what"]], one["day"], f"× {size:.3g}" if relative else f"{size:+.3g}",
            interval_text(low, high, _DIGITS), "times as much" if relative else one["unit"],
            p_value_text(one["p_value"]),
        ))  # fmt: skip
    return Table.of(("robot", "joint", "parameter", "finding", "date", "size", "95 % interval", "unit", "p"), rows)


def level_table(components: Iterable[Components]) -> Table:
    """Table of the levels of every joint beside those of its kind."""
    rows = []
    for one in unit_rows(components):
        factor, unit = display(one["parameter"], one["unit"])
        level, shrunk, mean, low, high = (
            factor * one[key] for key in ("level", "shrunk", "kind_mean", "low", "high")
        )  # fmt: skip
        rows.append((
            one["robot"], one["joint"], one["parameter"], number(level), interval_text(low, high, _DIGITS),
            number(shrunk), number(mean), unit, f"{one['from_kind']:+.1f} σ",
        ))  # fmt: skip
    away = "from its kind [σ, standard deviations of joints and of the level's error]"
    shown = ("level", "95 % interval", "shrunk to its kind", "mean of its kind", "unit", away)
    return Table.of(("robot", "joint", "parameter", *shown), rows)


def failed_table(document: Mapping[str, Any], *, merged: bool = True) -> Table:
    """Table of what could not be identified, each reason once if it is `merged`."""
    head = ("robot", "joint", "date", "bag", "reason")
    rows = [
        (one["robot"], one["joint"] or "-", str(one["time"] or "-")[:10], one["bag"], _reason(one))
        for one in document["failed"]
    ]
    if not merged:
        return Table.of(head, rows)
    groups: dict[str, list[tuple[str, ...]]] = {}
    for row in rows:
        groups.setdefault(row[-1], []).append(row)
    columns = (zip(head, zip(*several, strict=True), strict=True) for several in groups.values())
    return Table.of(head, ([_one_or_several(name, values) for name, values in one] for one in columns))


def _one_or_several(name: str, values: Iterable[str]) -> str:
    """The value that all rows have, or how many there are."""
    first, *others = dict.fromkeys(values)
    return f"{1 + len(others)} {name}s" if others else first


def _reason(one: Mapping[str, Any]) -> str:
    """Reason without the name of the bag, which stands beside it."""
    reason: str = one["reason"]
    return reason.partition(": ")[2] if reason.startswith(one["bag"]) else reason


def _first(table: Table, what: str, file: str) -> Iterator[Block]:
    if table.rows:
        yield Table(table.header, table.rows[:_MOST])
    if len(table.rows) > _MOST:
        yield f"and {len(table.rows) - _MOST} more {what}: {file}"
