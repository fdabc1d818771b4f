"""Curves over one variable: a fitted effect on the data that ask for it, and the force that no effect explains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.models import FixedTicker
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, add_zero_line, new_figure, source

if TYPE_CHECKING:
    from idloop.diagnosis import UnknownStructure
    from idloop.validation.characteristic import Characteristic


def characteristic_figure(one: Characteristic, theme: Theme = LIGHT, *, height: int = 260) -> figure:
    """Draw it.

    `height`: [CSS pixels].
    Returns: dots: the data along the motion; bars: their mean and deviation in each bin; line: the fitted effect.
    """
    plot = new_figure(theme, (one.variable, one.unit), (one.quantity, one.quantity_unit), height=height)
    dots = plot.scatter(
        "x", "y", source=source(x=one.x, y=one.y), size=3, fill_color=theme.band, fill_alpha=0.45, line_color=None
    )
    entries: list[tuple[str, list[Any]]] = [("left by the model without it", [dots])]
    if len(one.centre):
        columns = source(x=one.centre, y=one.mean, low=one.mean - one.band, high=one.mean + one.band)
        means = [
            plot.segment("x", "low", "x", "high", source=columns, color=theme.measured, line_width=2.0),
            plot.scatter("x", "y", source=columns, color=theme.measured, size=6),
        ]
        entries.append(("mean ± standard deviation", means))
    curve = plot.line("x", "y", source=source(x=one.curve_x, y=one.curve_y), color=theme.found, line_width=2.8)
    entries.append(("the fitted effect", [curve]))
    add_zero_line(plot, theme)
    if one.circular:
        plot.xaxis.ticker = FixedTicker(ticks=[0, 90, 180, 270, 360])
    add_legend(plot, theme, entries)
    return plot


def unknown_figure(unknown: UnknownStructure, theme: Theme = LIGHT) -> figure:
    """Draw the force (or command) that no effect of the catalogue explains, with its band."""
    at, force, half = (np.asarray(v, dtype=float) for v in (unknown.at, unknown.force, unknown.band))
    plot = new_figure(theme, (unknown.along, unknown.unit), (unknown.what, unknown.force_unit), height=240)
    data = source(x=at, y=force, low=force - half, high=force + half)
    band = plot.varea("x", "low", "high", source=data, fill_color=theme.band, fill_alpha=0.35)
    line = plot.line("x", "y", source=data, color=theme.found, line_width=2.2)
    add_zero_line(plot, theme)
    add_legend(plot, theme, [("estimate", [line]), ("95 % band", [band])])
    return plot
