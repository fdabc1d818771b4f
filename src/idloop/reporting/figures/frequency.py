"""Bode plot of measurement and model with the coherence of the measurement."""

from __future__ import annotations

from bokeh.models import Range1d
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.figures.ladder import number_decades
from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, source
from idloop.reporting.frequency_view import READABLE, FrequencyView


def frequency_figures(view: FrequencyView, output: int = 0, theme: Theme = LIGHT) -> list[figure]:
    """Draw magnitude, phase and coherence of one output, from the resolution upwards.

    What the coherence does not allow to be read is thin and grey, and has no phase.

    `output`: number of the output.
    Returns: their frequency axes are one.
    """
    frequency, measured = view.frequency, view.measured
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
    entries, unread = [], []
    for name, line, colour in zip(
        ("measured", "model"), view.bode(output), (theme.measured, theme.models[1]), strict=True
    ):
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
