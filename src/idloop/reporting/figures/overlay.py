"""Measured against models: every output with its residual below, and the command, on one time axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import Range1d
from bokeh.models.annotations import BoxAnnotation, Span
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, padded, source
from idloop.reporting.figures.thinning import BUCKETS, thinned
from idloop.reporting.frame import Frame
from idloop.reporting.plots.comparison import Panel


def overlay(
    panel: Panel,
    output_names: Sequence[str],
    output_units: Sequence[str],
    input_name: str,
    input_unit: str,
    theme: Theme = LIGHT,
    *,
    buckets: int = BUCKETS,
) -> list[figure]:
    """Draw one record and what the models say about it.

    Parameters
    ----------
    panel : Panel
        As for the printed figure (`idloop.reporting.plots.comparison`).
    buckets : int
        Stretches of time of which the least and the largest value are kept.

    Returns
    -------
    list of figure
        Two for each output, then the command; their time axes are linked.
    """
    time = ("time", "s")
    span = padded(float(panel.time[0]), float(panel.time[-1]), 0.01)
    plots: list[figure] = []
    for column, (name, unit) in enumerate(zip(output_names, output_units, strict=True)):
        top = new_figure(theme, time, (name, unit), x_range=span, height=258, **_cut(panel.value_frame(column)))
        measured = _line(top, panel.time, panel.output[:, column], buckets, color=theme.measured, line_width=2.4)
        entries = [("measured", [measured])]
        cut = _cut(panel.residual_frame(column))
        below = new_figure(theme, time, ("residual", unit), x_range=span, height=190, **cut)
        below.add_layout(Span(location=0.0, dimension="width", line_color=theme.measured, line_width=0.8))
        _add_band(below, panel, column, theme)
        for index, (label, modelled) in enumerate(panel.modelled.items()):
            look = {**theme.model(index), "line_width": 1.4}
            drawn = _line(top, panel.time, modelled[:, column], buckets, **look)
            left = _line(below, panel.time, panel.output[:, column] - modelled[:, column], buckets, **look)
            entries.append((panel.said(label, column), [drawn, left]))
        add_legend(top, theme, entries)
        plots += [top, below]
    command = new_figure(theme, time, (input_name, input_unit), x_range=span, height=165)
    _line(command, panel.input_time, panel.input, buckets, held=True, color=theme.command, line_width=1.2)
    return [*plots, command]


def _cut(frame: Frame | None) -> dict[str, Range1d]:
    """Range of a figure out of which a curve strays; else the figure finds its own."""
    return {"y_range": Range1d(start=frame.low, end=frame.high)} if frame is not None and frame.cut else {}


def _add_band(plot: figure, panel: Panel, column: int, theme: Theme) -> None:
    if panel.band is not None and np.isfinite(panel.band[column]):
        half = float(panel.band[column])
        plot.add_layout(BoxAnnotation(bottom=-half, top=half, fill_color=theme.band, fill_alpha=0.25, line_color=None))


def _line(plot: figure, x: Any, y: Any, buckets: int, *, held: bool = False, **look: Any) -> Any:
    place, value = thinned(x, y, buckets)
    draw = plot.step if held else plot.line
    if held:
        look["mode"] = "after"
    return draw("x", "y", source=source(x=place, y=value), **look)
