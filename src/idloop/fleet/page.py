"""The page of a fleet: heat map of joints, trends of the kinds with bands, what was found, reports of the worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any
from urllib.parse import quote

from idloop.fleet import words
from idloop.fleet.figures import MOST_ROWS, heat_map, trend
from idloop.fleet.statistics import Components
from idloop.reporting.page.sheet import render_sheet
from idloop.reporting.terms import capitalised

TEMPLATE = Path(__file__).parent / "templates" / "fleet.html"


def render_fleet(
    document: Mapping[str, Any], components: Sequence[Components], reports: Mapping[tuple[str, str], str]
) -> str:
    """Write the page of a fleet and its document of schema ``idloop/fleet/1``; `reports`: address of each joint's."""
    framed = {(one["robot"], one["joint"]) for one in document["diagnoses"]}
    kinds = [one.series.kind for one in components]
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
        headline=words.headline(document),
        document=document,
        words=words,
        trends=[f"{words.kind_text(one.series.kind, kinds)}: {one.series.parameter}" for one in components],
        most=MOST_ROWS,
        capitalised=capitalised,
        address=lambda name: quote(reports[name], safe="/?"),
        robots={robot: list(several) for robot, several in groupby(sorted(reports), itemgetter(0))},
    )
