"""The report of a robot as one HTML page that loads nothing: a table, and a card for each joint."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from idloop import __version__
from idloop.p_values import p_value_text
from idloop.reporting.figures.ladder import ladder_figures
from idloop.reporting.figures.theme import DARK, LIGHT
from idloop.reporting.page.page import TEMPLATES, browser_code, figure_items
from idloop.reporting.terms import capitalised, effect_words
from idloop.robots.figures import torque_figures
from idloop.robots.identify import Robot
from idloop.robots.words import effect_lines, joint_table, judged_error, link_table, parameter_lines, payload_lines

OWN = Path(__file__).parent / "templates"


def render_robot(robot: Robot, document: Mapping[str, Any]) -> str:
    """Write the page of a robot and its document of schema ``idloop/robot/1``."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    places = {}
    for place, (joint, ladder) in enumerate(zip(document["joints"], robot.ladders, strict=True)):
        places[f"torque-{joint['name']}"] = torque_figures(robot, place)
        if ladder.added:
            places[f"ladder-{joint['name']}"] = ladder_figures(ladder)
    environment = Environment(
        loader=FileSystemLoader([OWN, TEMPLATES]), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    palettes = {theme.name: theme.colours for theme in (LIGHT, DARK)}
    # Markup: our own files and JSON, and Bokeh's code; every word of the user's is escaped by the template.
    return environment.get_template("robot.html").render(
        name=Path(document["urdf"]).stem,
        document=document,
        headline=headline(document),
        joints=joint_table(document),
        links=link_table(document),
        judged={one["name"]: judged_error(one) for one in document["joints"]},
        payload=[] if document["payload"] is None else list(payload_lines(document["payload"])),
        shown=robot.errors[-1],
        places=set(places),
        light=LIGHT,
        dark=DARK,
        effect_words=effect_words,
        p_text=p_value_text,
        effect_lines=effect_lines,
        parameter_lines=parameter_lines,
        capitalised=capitalised,
        style=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),  # noqa: S704
        script=Markup((TEMPLATES / "report.js").read_text(encoding="utf-8")),  # noqa: S704
        bokeh=Markup(browser_code()),  # noqa: S704
        figures=Markup(figure_items(places)),  # noqa: S704
        palettes=Markup(json.dumps(palettes)),  # noqa: S704
        version=__version__,
    )


def headline(document: Mapping[str, Any]) -> str:
    """What was found, in one line."""
    found = [effect_words(one["effect"]) for joint in document["joints"] for one in joint["added"]]
    count = len(document["joints"])
    if not found:
        return f"{count} joints, and nothing that they lack is significant"
    return f"{count} joints; missing: {', '.join(found)}"
