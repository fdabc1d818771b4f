"""Measured against models: over time with residuals, drive force, over frequency, correlations of the residual."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from bokeh.models import Range1d
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.arrays import Array, Mask
from idloop.reporting.figures.ladder import number_decades
from idloop.reporting.figures.theme import (
    BUCKETS,
    LIGHT,
    Theme,
    add_band,
    add_heading,
    add_legend,
    add_zero_line,
    draw_thinned,
    new_figure,
    padded,
    source,
)
from idloop.reporting.frequency_view import READABLE, FrequencyView
from idloop.reporting.panel import Frame, Panel
from idloop.validation.drive import ForceError
from idloop.validation.residual import ResidualTest
from idloop.validation.words import force_text


def overlay(panel: Panel, theme: Theme = LIGHT, *, buckets: int = BUCKETS) -> list[figure]:
    """Draw one record and what the models say about it.

    `buckets`: stretches of time of which the least and the largest value are kept.
    Returns: two for each output, then the command; their time axes are linked.
    """
    record, time = panel.record, ("time", "s")
    span = padded(float(panel.time[0]), float(panel.time[-1]), 0.01)
    plots: list[figure] = []
    for column, (name, unit) in enumerate(zip(record.output_names, record.output_units, strict=True)):
        top = new_figure(theme, time, (name, unit), x_range=span, height=258, **_cut(panel.value_frame(column)))
        measured = draw_thinned(top, panel.time, panel.output[:, column], buckets, color=theme.measured, line_width=2.4)
        entries = [("measured", [measured])]
        cut = _cut(panel.residual_frame(column))
        below = new_figure(theme, time, ("residual", unit), x_range=span, height=190, **cut)
        add_zero_line(below, theme)
        if (half := panel.half_band(column)) is not None:
            add_heading(below, "grey: 95 % of the sensor noise")
            add_band(below, -half, half, theme)
        for index, (label, modelled) in enumerate(panel.values(column).items()):
            look = {**theme.model(index), "line_width": 1.4}
            drawn = draw_thinned(top, panel.time, modelled, buckets, **look)
            left = draw_thinned(below, panel.time, panel.output[:, column] - modelled, buckets, **look)
            entries.append((panel.legend_entry(label, column), [drawn, left]))
        add_legend(top, theme, entries)
        plots += [top, below]
    command = new_figure(theme, time, (record.input_name, record.input_unit), x_range=span, height=165)
    draw_thinned(command, record.input_time, record.input, buckets, held=True, color=theme.command, line_width=1.2)
    return [*plots, command]


def force_figures(
    models: Sequence[tuple[str, ForceError]], unit: str, theme: Theme = LIGHT, *, buckets: int = BUCKETS
) -> list[figure]:
    """Draw the drive side of models on one record, by their labels; `unit` is that of the force.

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


def frequency_figures(view: FrequencyView, output: int = 0, theme: Theme = LIGHT) -> list[figure]:
    """Draw magnitude, phase and coherence of the output number `output`, from the resolution upwards, on one axis.

    What the coherence does not allow to be read is thin and grey, and has no phase.
    """
    frequency, measured = view.frequency, view.measured
    unit = f"{measured.output_units[output]}/{measured.input_units[0]}"
    across = Range1d(start=float(frequency[0]), end=float(frequency[-1]))
    look = {"x_axis_type": "log", "x_range": across}
    size = new_figure(theme, ("", None), ("magnitude", unit), y_axis_type="log", height=190, **look)
    lines = view.bode(output)
    angles = np.concatenate([line.phase[np.isfinite(line.phase)] for line in lines])
    turn = padded(float(np.min(angles)), float(np.max(angles))) if len(angles) else Range1d(start=-180.0, end=0.0)
    # A range of its own: a figure that finds none, where nothing can be read, draws no axes and complains.
    phase = new_figure(theme, ("", None), ("phase", "deg"), height=150, y_range=turn, **look)
    coherence = new_figure(
        theme, ("frequency", "Hz"), ("coherence", "-"), height=150, y_range=Range1d(start=0.0, end=1.05), **look
    )
    for plot in (size, phase, coherence):
        number_decades(plot, float(frequency[0]), float(frequency[-1]))
    entries, unread = [], []
    for name, line, colour in zip(("measured", "model"), lines, (theme.measured, theme.models[1]), strict=True):
        columns = source(frequency=frequency, read=line.read, unread=line.unread, phase=line.phase)
        faint = size.line("frequency", "unread", source=columns, color=theme.band, line_width=0.8)
        unread.append(faint)
        drawn = size.line("frequency", "read", source=columns, color=colour, line_width=1.6)
        # A line that stands alone is a dot.
        size.scatter("frequency", "read", source=columns, color=colour, size=3)
        phase.scatter("frequency", "phase", source=columns, color=colour, size=3)
        phase.line("frequency", "phase", source=columns, color=colour, line_width=1.6)
        entries.append((name, [drawn]))
    known = view.coherence(output)
    if known is not None:
        columns = source(frequency=frequency, coherence=known)
        coherence.line("frequency", "coherence", source=columns, color=theme.measured, line_width=1.6)
        coherence.add_layout(
            Span(location=READABLE, dimension="width", line_color=theme.muted, line_dash=[4, 4], line_width=1)
        )
        entries.append((f"coherence below {READABLE:g}: not to be read", unread))
    add_legend(size, theme, entries)
    return [size, phase, coherence]


def residual_figures(test: ResidualTest, theme: Theme = LIGHT) -> list[figure]:
    """Draw the tests of one output's one-step residual.

    Returns: autocorrelation, correlation with the input; the band holds 99 % of the values of a residual that is noise.
    Lags that are not tested are grey: feedback alone makes a correlation there.
    """
    own = (test.lag, test.autocorrelation, test.autocorrelation_band)
    cross = (test.cross_lag, test.cross_correlation, test.cross_correlation_band)
    # A phone cuts what is longer.
    named = f"correlation with {test.against} (grey: not tested)"
    return [
        _stems(theme, "autocorrelation", *own, np.ones(len(test.lag), dtype=bool), passed=test.white),
        _stems(theme, named, *cross, (test.cross_lag > 0) & test.decided, passed=test.input_free),
    ]


def _stems(theme: Theme, name: str, lag: Array, value: Array, half: Array, tested: Mask, *, passed: bool) -> figure:
    # The whole name along the axis would be longer than the axis.
    plot = new_figure(theme, ("lag", "samples"), ("correlation", "-"), height=205, title=name)
    colours = np.where(tested, theme.models[0] if passed else theme.found, theme.band)
    data = source(x=lag, y=value, low=-np.asarray(half), high=np.asarray(half), colour=list(colours))
    plot.varea("x", "low", "high", source=data, fill_color=theme.band, fill_alpha=0.3)
    plot.segment("x", 0, "x", "y", source=data, color="colour", line_width=2.0)
    plot.scatter("x", "y", source=data, color="colour", size=4)
    add_zero_line(plot, theme)
    return plot
