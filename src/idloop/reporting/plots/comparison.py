"""Figures of a model beside records: over time, over frequency, and the tests of its one-step residual."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.reporting.frequency_view import READABLE, FrequencyView
from idloop.reporting.panel import Frame, Panel, widest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.validation import ResidualTest


def plot_panels(panels: Sequence[Panel]) -> Figure:
    """Draw the panels of records that have the same signals, a column each."""
    record = panels[0].record
    with drawing.styled():
        heights = (2.0, 1.2) * len(record.output_names) + (1.2,)
        figure, axes = drawing.new_figure(len(heights), len(panels), heights)
        for column, panel in enumerate(panels):
            _draw_panel(axes[:, column], panel)
        for row, (name, unit) in enumerate(zip(record.output_names, record.output_units, strict=True)):
            top, below = axes[2 * row : 2 * row + 2, 0]
            top.set_ylabel(drawing.label(name, unit))
            below.set_ylabel(drawing.label("residual", unit))
            _fit_frame(top, widest(panel.value_frame(row) for panel in panels))
            _fit_frame(below, widest(panel.residual_frame(row) for panel in panels))
        axes[-1, 0].set_ylabel(drawing.label(record.input_name, record.input_unit))
        figure.align_ylabels(axes[:, 0])
    return figure


def _fit_frame(axes: Any, frame: Frame | None) -> None:
    """Cut off what strays; the axes of a row are linked."""
    if frame is not None:
        axes.set_ylim(frame.low, frame.high)


def _draw_panel(axes: Any, panel: Panel) -> None:
    axes[0].set_title(panel.title, loc="left", fontweight="bold", pad=20)  # clear of the legend
    for row in range(len(panel.record.output_names)):
        top, below = axes[2 * row], axes[2 * row + 1]
        drawing.line(top, panel.time, panel.output[:, row], color=drawing.MEASURED, linewidth=1.6, label="measured")
        below.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
        for index, (label, modelled) in enumerate(panel.modelled.items()):
            look = drawing.model_look(index)
            drawing.line(top, panel.time, modelled[:, row], label=panel.legend_entry(label, row), **look)
            drawing.line(below, panel.time, panel.output[:, row] - modelled[:, row], **look)
        if (half := panel.half_band(row)) is not None:
            below.axhspan(-half, half, color=drawing.BAND, alpha=0.25, linewidth=0, label="95 % band of the noise")
            legend_above(below, 1)
        legend_above(top, 1 + len(panel.modelled))
    drawing.steps(axes[-1], panel.record.input_time, panel.record.input, color=drawing.COMMAND)
    axes[-1].set_xlabel(drawing.label("time", "s"))


def legend_above(axes: Any, entries: int) -> None:
    """Write the legend above the axes, to the right of their title."""
    if not axes.get_legend_handles_labels()[0]:
        return
    # Outside the axes: inside, it would lie on the curves somewhere.
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0, ncols=min(entries, 3), columnspacing=1.2
    )


def plot_frequency(view: FrequencyView, output: int, title: str) -> Figure:
    """Draw magnitude, phase and coherence of one output; grey where the coherence does not allow to read it."""
    measured = view.measured
    with drawing.styled():
        figure, axes = drawing.new_figure(3, 1, (2.2, 1.5, 1.3))
        size, phase, coherence = axes[:, 0]
        unread = f"coherence below {READABLE:g}: not to be read"
        for name, line, colour in zip(
            ("measured", "model"), view.bode(output), (drawing.MEASURED, drawing.MODELS[1]), strict=True
        ):
            size.loglog(view.frequency, line.unread, color=drawing.BAND, linewidth=0.6, label=unread)
            size.loglog(view.frequency, line.read, ".-", markersize=3, color=colour, label=name)
            phase.semilogx(view.frequency, line.phase, ".-", markersize=3, color=colour)
            unread = "_"
        known = view.coherence(output)
        if known is not None:
            coherence.semilogx(view.frequency, known, color=drawing.MEASURED)
            coherence.axhline(READABLE, color=drawing.COMMAND, linewidth=0.7, linestyle="--")
        unit = f"{measured.output_units[output]}/{measured.input_units[0]}"
        size.set_ylabel(drawing.label("magnitude", unit))
        phase.set_ylabel(drawing.label("phase", "deg"))
        coherence.set(
            ylabel=drawing.label("coherence", None), xlabel=drawing.label("frequency", "Hz"), ylim=(0.0, 1.05)
        )
        size.set_title(title, loc="left", fontweight="bold")
        size.legend(loc="best")
        figure.align_ylabels(axes[:, 0])
    return figure


def plot_residual(test: ResidualTest, title: str) -> Figure:
    """Draw correlations of the one-step residual of an output, with the bands that hold 99 % of those of noise."""
    with drawing.styled():
        from matplotlib.figure import Figure as NewFigure

        figure = NewFigure(figsize=(7.5, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1)
        own = (test.lag, test.autocorrelation, test.autocorrelation_band, test.white)
        cross = (test.cross_lag, test.cross_correlation, test.cross_correlation_band, test.input_free)
        _stems(above, "autocorrelation", *own)
        _stems(below, f"correlation with {test.against}", *cross)
        above.set_title(title, loc="left", fontweight="bold")
        below.set_xlabel(drawing.label("lag", "samples"))
    return figure


def _stems(axes: Any, name: str, lag: Any, value: Any, half: Any, passed: bool) -> None:
    reach = np.broadcast_to(np.asarray(half, dtype=float), np.shape(lag))
    axes.fill_between(lag, -reach, reach, color=drawing.BAND, alpha=0.3, linewidth=0, label="99 % of those of noise")
    axes.vlines(lag, 0.0, value, color=drawing.MODELS[0 if passed else 1])
    axes.plot(lag, value, ".", color=drawing.MODELS[0 if passed else 1])
    axes.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    axes.set_ylabel(drawing.label(name, None))
    axes.legend(loc="best")
