"""Figures of the linear part: frequency response of measurement and model, and the tests of the one-step residual."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.reporting.frequency_view import READABLE, FrequencyView

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.validation import ResidualTest


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
        _stems(above, "autocorrelation", test.lag, test.autocorrelation, test.autocorrelation_band, test.white)
        _stems(
            below, f"correlation with {test.against}", test.cross_lag, test.cross_correlation,
            test.cross_correlation_band, test.input_free,
        )  # fmt: skip
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
