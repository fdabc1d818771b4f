"""The report of a robot as one HTML page that loads nothing: a table, and a card for each joint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from idloop.p_values import p_value_text
from idloop.reporting.figures.ladder import ladder_figures
from idloop.reporting.page.sheet import render_sheet
from idloop.reporting.terms import capitalised, effect_words
from idloop.robots import words
from idloop.robots.figures import torque_figures
from idloop.robots.identify import Robot

OWN = Path(__file__).parent / "templates"


def render_robot(robot: Robot, document: Mapping[str, Any]) -> str:
    """Write the page of a robot and its document of schema ``idloop/robot/1``."""
    places = {}
    for place, (joint, ladder) in enumerate(zip(document["joints"], robot.ladders, strict=True)):
        places[f"torque-{joint['name']}"] = torque_figures(robot, place)
        if ladder.added:
            places[f"ladder-{joint['name']}"] = ladder_figures(ladder)
    return render_sheet(
        OWN / "robot.html",
        places,
        name=Path(document["urdf"]).stem,
        document=document,
        headline=headline(document),
        words=words,
        shown=robot.errors[-1],
        effect_words=effect_words,
        p_text=p_value_text,
        capitalised=capitalised,
    )


def headline(document: Mapping[str, Any]) -> str:
    """What was found, in one line."""
    found = [effect_words(one["effect"]) for joint in document["joints"] for one in joint["added"]]
    count = len(document["joints"])
    if not found:
        return f"{count} joints, and nothing that they lack is significant"
    return f"{count} joints; missing: {', '.join(found)}"
