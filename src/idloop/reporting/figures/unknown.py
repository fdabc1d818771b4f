"""The force (or command) that no effect of the catalogue explains, as a learnt curve with its band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, source

if TYPE_CHECKING:
    from idloop.diagnosis import UnknownStructure


def unknown_figure(unknown: UnknownStructure, theme: Theme = LIGHT) -> figure:
    """Draw it."""
    at, force, half = (np.asarray(v, dtype=float) for v in (unknown.at, unknown.force, unknown.band))
    plot = new_figure(theme, (unknown.along, unknown.unit), (unknown.what, unknown.force_unit), height=240)
    data = source(x=at, y=force, low=force - half, high=force + half)
    band = plot.varea("x", "low", "high", source=data, fill_color=theme.band, fill_alpha=0.35)
    line = plot.line("x", "y", source=data, color=theme.found, line_width=2.2)
    plot.add_layout(Span(location=0.0, dimension="width", line_color=theme.measured, line_width=0.8))
    add_legend(plot, theme, [("as learnt", [line]), ("its 95 % band", [band])])
    return plot
