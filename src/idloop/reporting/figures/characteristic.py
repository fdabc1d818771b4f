"""A small picture of an effect: the force (or signal) that the model without it leaves, and the fitted curve on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bokeh.models import FixedTicker
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, source

if TYPE_CHECKING:
    from idloop.diagnosis.evidence.characteristic import Characteristic


def characteristic_figure(one: Characteristic, theme: Theme = LIGHT, *, height: int = 260) -> figure:
    """Draw it.

    Parameters
    ----------
    height : int
        [CSS pixels].

    Returns
    -------
    figure
        Dots: the data along the motion; bars: their mean and deviation in each bin; line: the fitted effect.
    """
    plot = new_figure(theme, (one.variable, one.unit), (one.quantity, one.quantity_unit), height=height)
    dots = plot.scatter(
        "x", "y", source=source(x=one.x, y=one.y), size=3, fill_color=theme.band, fill_alpha=0.45, line_color=None
    )
    entries: list[tuple[str, list[Any]]] = [("what the model without it leaves", [dots])]
    if len(one.centre):
        columns = source(x=one.centre, y=one.mean, low=one.mean - one.band, high=one.mean + one.band)
        means = [
            plot.segment("x", "low", "x", "high", source=columns, color=theme.measured, line_width=2.0),
            plot.scatter("x", "y", source=columns, color=theme.measured, size=6),
        ]
        entries.append(("its mean ± deviation", means))
    curve = plot.line("x", "y", source=source(x=one.curve_x, y=one.curve_y), color=theme.found, line_width=2.8)
    entries.append(("the fitted effect", [curve]))
    plot.add_layout(Span(location=0.0, dimension="width", line_color=theme.measured, line_width=0.8))
    if one.circular:
        plot.xaxis.ticker = FixedTicker(ticks=[0, 90, 180, 270, 360])
    add_legend(plot, theme, entries)
    return plot
