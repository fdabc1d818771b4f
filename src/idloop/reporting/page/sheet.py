"""A page of tables and figures that loads nothing, from a template of its own on the common sheet."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop import __version__
from idloop.reporting.figures.theme import DARK, LIGHT

if TYPE_CHECKING:
    from bokeh.plotting import figure

TEMPLATES = Path(__file__).parent / "templates"


def render_sheet(template: Path, places: Mapping[str, Sequence[figure]], **words: Any) -> str:
    """Write a page: HTML that loads nothing.

    `template`: extends ``sheet.html``.
    `places`: figures that stand below one another, by the name of their place.
    `**words`: for the template; ``name`` and ``headline`` among them.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader([template.parent, TEMPLATES]), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    palettes = {theme.name: theme.colours for theme in (LIGHT, DARK)}
    # Markup: our own files and JSON, and Bokeh's code; every word of the user's is escaped by the template.
    return environment.get_template(template.name).render(
        **words,
        places=set(places),
        light=LIGHT,
        dark=DARK,
        style=Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),  # noqa: S704
        script=Markup((TEMPLATES / "report.js").read_text(encoding="utf-8")),  # noqa: S704
        bokeh=Markup(browser_code()),  # noqa: S704
        figures=Markup(figure_items(places)),  # noqa: S704
        palettes=Markup(json.dumps(palettes)),  # noqa: S704
        version=__version__,
    )


def figure_items(places: Mapping[str, Sequence[figure]]) -> str:
    """Figures as a JSON text that may stand in a script element.

    `places`: figures that stand below one another, by the name of their place.
    """
    from bokeh.embed import json_item
    from bokeh.layouts import column

    items: dict[str, Any] = {}
    for name, figures in places.items():
        items[name] = json_item(column(*figures, sizing_mode="stretch_width"))
    return json_text(items)


def json_text(value: Any) -> str:
    """JSON that may stand in a script element: a closing tag in a name does not close it."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=True).replace("</", "<\\/")


def browser_code() -> str:
    """The JavaScript of Bokeh that the figures need: no widgets, no tables, no fonts."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw).replace("</script", "<\\/script")
