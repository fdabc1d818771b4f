"""Bode plot of measurement and model with the coherence of the measurement."""

from __future__ import annotations

import numpy as np
from bokeh.models import Range1d
from bokeh.plotting import figure

from idloop.reporting.figures.ladder import number_decades
from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, source
from idloop.reporting.frequency_view import FrequencyView


def frequency_figures(view: FrequencyView, output: int = 0, theme: Theme = LIGHT) -> list[figure]:
    """Draw magnitude, phase and coherence of one output, from the resolution upwards.

    Parameters
    ----------
    output : int
        Number of the output.

    Returns
    -------
    list of figure
        Their frequency axes are one.
    """
    measured, kept = view.measured, view.measured.resolved
    frequency = measured.frequency[kept]
    unit = f"{measured.output_units[output]}/{measured.input_units[0]}"
    across = Range1d(start=float(frequency[0]), end=float(frequency[-1]))
    look = {"x_axis_type": "log", "x_range": across}
    size = new_figure(theme, ("", None), ("magnitude", unit), y_axis_type="log", height=190, **look)
    phase = new_figure(theme, ("", None), ("phase", "deg"), height=150, **look)
    coherence = new_figure(
        theme, ("frequency", "Hz"), ("coherence", "-"), height=150, y_range=Range1d(start=0.0, end=1.05), **look
    )
    for plot in (size, phase, coherence):
        number_decades(plot, float(frequency[0]), float(frequency[-1]))
    entries = []
    modelled, found = (one.response[kept, output, 0] for one in (view.model, measured))
    angle = np.unwrap(np.angle(modelled))
    # The measured phase lies within half a turn of the model's: unwrapped by itself, noise turns it over and over.
    for name, value, turned, colour in (
        ("measured", found, angle + np.angle(found * np.conj(modelled)), theme.measured),
        ("model", modelled, angle, theme.models[1]),
    ):
        columns = source(frequency=frequency, magnitude=np.abs(value), phase=np.degrees(turned))
        drawn = [
            plot.line("frequency", y, source=columns, color=colour, line_width=1.6)
            for plot, y in ((size, "magnitude"), (phase, "phase"))
        ]
        entries.append((name, drawn[:1]))
    if measured.coherence is not None:
        columns = source(frequency=frequency, coherence=measured.coherence[kept, output])
        coherence.line("frequency", "coherence", source=columns, color=theme.measured, line_width=1.6)
    add_legend(size, theme, entries)
    return [size, phase, coherence]
