"""The report as one HTML page that loads nothing: words, figures and the browser code that draws them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop import __version__
from idloop.reporting.figures.theme import DARK, LIGHT
from idloop.reporting.page.equations import equations, to_mathml
from idloop.reporting.page.page_figures import page_figures
from idloop.reporting.page.page_words import page_words
from idloop.reporting.terms import effect_words

if TYPE_CHECKING:
    from bokeh.plotting import figure

    from idloop.reporting.page.contents import Contents

TEMPLATES = Path(__file__).parent / "templates"


def render_page(contents: Contents) -> str:
    """Write the page.

    Returns
    -------
    str
        HTML. It loads nothing, and its own policy forbids the browser to.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    places = page_figures(contents)
    lines, symbols = equations(contents.ladder.model)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    context: dict[str, Any] = page_words(contents)
    palettes = {theme.name: theme.colours for theme in (LIGHT, DARK)}
    # Markup: our own files, MathML and JSON, and Bokeh's code; every word of the user's is escaped by the template.
    return environment.get_template("report.html").render(
        **context,
        places=set(places),
        light=LIGHT,
        dark=DARK,
        equations=[
            (Markup(to_mathml(line.latex, block=True)), line.about, effect_words(line.effect))  # noqa: S704
            for line in lines
        ],
        symbols={name: Markup(to_mathml(symbol)) for name, symbol in symbols.items()},  # noqa: S704
        style=Markup(_read("report.css")),  # noqa: S704
        script=Markup(_read("report.js")),  # noqa: S704
        bokeh=Markup(browser_code()),  # noqa: S704
        figures=Markup(figure_items(places)),  # noqa: S704
        palettes=Markup(json.dumps(palettes)),  # noqa: S704
        version=__version__,
    )


def _read(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def figure_items(places: Mapping[str, Sequence[figure]]) -> str:
    """Figures as a JSON text that may stand in a script element.

    Parameters
    ----------
    places : mapping of str to sequence of figure
        Figures that stand below one another, by the name of their place.
    """
    from bokeh.embed import json_item
    from bokeh.layouts import column

    items: dict[str, Any] = {}
    for name, figures in places.items():
        items[name] = json_item(column(*figures, sizing_mode="stretch_width"))
    # A closing tag in a name must not close the script.
    return json.dumps(items, separators=(",", ":"), ensure_ascii=False, allow_nan=True).replace("</", "<\\/")


def browser_code() -> str:
    """The JavaScript of Bokeh that the figures need: no widgets, no tables, no fonts."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw).replace("</script", "<\\/script")
