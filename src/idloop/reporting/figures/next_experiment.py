"""The next experiment: what it sends in, what each rival would show, and by how much they differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.experiment_rows import Row, reach, rival_name, rows_of
from idloop.reporting.figures.theme import BUCKETS, LIGHT, Theme, add_band, add_legend, draw_thinned, new_figure, padded
from idloop.reporting.terms import in_words

if TYPE_CHECKING:
    from idloop.diagnosis.design.suggest import Suggestion

_HEIGHTS = {"sent": 175, "output": 200, "difference": 204}


def experiment_figures(suggestion: Suggestion, theme: Theme = LIGHT, *, buckets: int = BUCKETS) -> list[figure]:
    """Draw a suggested experiment with its rivals, simulated with each of them.

    Returns: what is sent in, then for each output the rivals and their differences from the first one; linked in time.
    """
    span = padded(0.0, suggestion.experiment.duration, 0.01)
    plots, named = [], False
    for row in rows_of(suggestion):
        plot, glyphs = _draw(row, theme, span, buckets, _heading(row, suggestion))
        if not named and row.curves[0].rival is not None:
            # As short as a phone wants it; what the differences are from stands above them.
            names = (rival_name(suggestion, index, first=False) for index in range(len(glyphs)))
            add_legend(plot, theme, [(name, [glyph]) for name, glyph in zip(names, glyphs, strict=True)])
            named = True
        plots.append(plot)
    return plots


def _heading(row: Row, suggestion: Suggestion) -> str:
    """Limits, bands and the difference of a row in words."""
    # With many rivals their differences do not fit a line; the outcomes beside the figure have the numbers.
    several = len(suggestion.rivals) > 2
    notes = [text for text, which in row.entries if not (several and which.isdigit())]
    begin = [f"from {in_words(suggestion.rivals[0][0])}"] if row.kind == "difference" else []
    # A line each: a phone cuts what is longer.
    return "\n".join([*begin, *notes])


def _draw(row: Row, theme: Theme, span: Any, buckets: int, heading: str) -> tuple[figure, list[Any]]:
    name, _, unit = row.label.rpartition(" [")
    low, high = reach(row.curves)
    if row.band is not None:
        low, high = min(low, -1.3 * row.band), max(high, 1.3 * row.band)
    low, high = min((low, *row.limits)), max((high, *row.limits))
    plot = new_figure(
        theme, ("time", "s"), (name, unit.rstrip("]")),
        x_range=span, y_range=padded(low, high), height=_HEIGHTS[row.kind], title=heading,
    )  # fmt: skip
    for limit in row.limits:
        plot.add_layout(Span(location=limit, dimension="width", line_color=theme.limit, line_dash=[6, 3], line_width=1))
    if row.band is not None:
        add_band(plot, -row.band, row.band, theme)
    glyphs: list[Any] = []
    for curve in row.curves:
        if curve.rival is None:
            look: dict[str, Any] = {"color": theme.command, "line_width": 1.3}
        else:
            wide = curve.rival == 0 and row.kind != "difference"
            look = {**theme.model(curve.rival), "line_width": 3.0 if wide else 1.3, "alpha": 0.55 if wide else 1.0}
        glyphs.append(draw_thinned(plot, curve.time, curve.value, buckets, held=curve.held, **look))
    return plot, glyphs
