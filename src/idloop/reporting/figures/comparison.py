"""Measured against models on one time axis: outputs with residuals and the command; applied and needed drive force."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import Range1d
from bokeh.models.annotations import BoxAnnotation
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, add_zero_line, new_figure, padded
from idloop.reporting.figures.thinning import BUCKETS, draw_thinned
from idloop.reporting.frame import Frame
from idloop.reporting.plots.comparison import Panel
from idloop.validation.drive import ForceError
from idloop.validation.words import force_text


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

    `panel`: as for the printed figure (`idloop.reporting.plots.comparison`).
    `buckets`: stretches of time of which the least and the largest value are kept.
    Returns: two for each output, then the command; their time axes are linked.
    """
    time = ("time", "s")
    span = padded(float(panel.time[0]), float(panel.time[-1]), 0.01)
    plots: list[figure] = []
    for column, (name, unit) in enumerate(zip(output_names, output_units, strict=True)):
        top = new_figure(theme, time, (name, unit), x_range=span, height=258, **_cut(panel.value_frame(column)))
        measured = draw_thinned(top, panel.time, panel.output[:, column], buckets, color=theme.measured, line_width=2.4)
        entries = [("measured", [measured])]
        cut = _cut(panel.residual_frame(column))
        below = new_figure(theme, time, ("residual", unit), x_range=span, height=190, **cut)
        add_zero_line(below, theme)
        _add_band(below, panel, column, theme)
        for index, (label, modelled) in enumerate(panel.modelled.items()):
            look = {**theme.model(index), "line_width": 1.4}
            drawn = draw_thinned(top, panel.time, modelled[:, column], buckets, **look)
            left = draw_thinned(below, panel.time, panel.output[:, column] - modelled[:, column], buckets, **look)
            entries.append((panel.legend_entry(label, column), [drawn, left]))
        add_legend(top, theme, entries)
        plots += [top, below]
    command = new_figure(theme, time, (input_name, input_unit), x_range=span, height=165)
    draw_thinned(command, panel.input_time, panel.input, buckets, held=True, color=theme.command, line_width=1.2)
    return [*plots, command]


def force_figures(
    models: Sequence[tuple[str, ForceError]], unit: str, theme: Theme = LIGHT, *, buckets: int = BUCKETS
) -> list[figure]:
    """Draw the drive side of models on one record.

    `models`: sequence of (str, ForceError). Label of each model and its drive side.
    `unit`: of the force.
    `buckets`: as for `idloop.reporting.figures.thinning.kept`.
    Returns: forces, then what each model misses. Models that change the command apply another force: each is drawn as
    what was applied by the first less its own error.
    """
    if not models:
        return []
    first = models[0][1]
    span = padded(float(first.time[0]), float(first.time[-1]), 0.01)
    time = ("time", "s")
    top = new_figure(theme, time, ("drive force", unit), x_range=span, height=258)
    below = new_figure(theme, time, ("difference", unit), x_range=span, height=190)
    add_zero_line(below, theme)
    applied = draw_thinned(top, first.time, first.applied, buckets, color=theme.measured, line_width=2.4)
    entries = [("applied", [applied])]
    for index, (label, one) in enumerate(models):
        look = {**theme.model(index), "line_width": 1.4}
        error = one.applied - one.required
        same = len(one.time) == len(first.time)
        needed = draw_thinned(top, one.time, (first.applied if same else one.applied) - error, buckets, **look)
        missed = draw_thinned(below, one.time, error, buckets, **look)
        # In as few words as a phone has room for.
        size = f"error {force_text(one.relative, 3, ' %')}" if one.trusted else "its error may be noise"
        entries.append((f"needed by {label} ({size})", [needed, missed]))
    add_legend(top, theme, entries)
    return [top, below]


def _cut(frame: Frame | None) -> dict[str, Range1d]:
    """Range of a figure out of which a curve strays; else the figure finds its own."""
    return {"y_range": Range1d(start=frame.low, end=frame.high)} if frame is not None and frame.cut else {}


def _add_band(plot: figure, panel: Panel, column: int, theme: Theme) -> None:
    if panel.band is not None and np.isfinite(panel.band[column]):
        half = float(panel.band[column])
        heading: Any = plot.title
        heading.text = "grey: 95 % of the sensor noise"
        plot.height = int(plot.height or 0) + 18
        plot.add_layout(BoxAnnotation(bottom=-half, top=half, fill_color=theme.band, fill_alpha=0.25, line_color=None))
