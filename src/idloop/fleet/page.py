"""The page of a fleet: heat map of joints, trends of the kinds with bands, what was found, reports of the worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from idloop.fleet.figures import MOST_ROWS, heat_map, trend
from idloop.fleet.statistics import Components
from idloop.fleet.words import (
    alarms_words,
    failed_table,
    finding_table,
    findings_words,
    headline,
    kind_table,
    periods_words,
    read_words,
)
from idloop.reporting.page.sheet import render_sheet
from idloop.reporting.terms import capitalised

TEMPLATE = Path(__file__).parent / "templates" / "fleet.html"


def render_fleet(
    document: Mapping[str, Any], components: Sequence[Components], reports: Mapping[tuple[str, str], str]
) -> str:
    """Write the page of a fleet and its document of schema ``idloop/fleet/1``; `reports`: address of each joint's."""
    framed = {(one["robot"], one["joint"]) for one in document["diagnoses"]}
    places = {"heat": heat_map(components, reports, framed)} if components else {}
    for number, parts in enumerate(components):
        own = [
            (one["robot"], one["joint"])
            for one in document["findings"]
            if one["robot"] and (one["kind"], one["parameter"]) == (parts.series.kind, parts.series.parameter)
        ]
        places[f"trend-{number}"] = trend(parts, list(dict.fromkeys(own)))
    return render_sheet(
        TEMPLATE,
        places,
        name=document["source"],
        document=document,
        headline=headline(document),
        words={
            "read": read_words(document["new"], document["bags"]),
            "findings": findings_words(document),
            "periods": periods_words(document) if document["since"] else "",
            "alarms": alarms_words(document),
        },
        findings=finding_table(document["findings"]),
        periods=finding_table(document["periods"]),
        alarms=finding_table(document["alarms"]),
        failed=failed_table(document),
        kinds=kind_table(document),
        trends=[f"{one.series.kind}: {one.series.parameter}" for one in components],
        most=MOST_ROWS,
        capitalised=capitalised,
        address=lambda name: quote(reports[name], safe="/?"),
        reports=reports,
        robots={robot: [one for one in sorted(reports) if one[0] == robot] for robot, _ in sorted(reports)},
    )
