"""Figures and the browser code that draws them as text for one page: nothing is loaded from anywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bokeh.plotting import figure


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
