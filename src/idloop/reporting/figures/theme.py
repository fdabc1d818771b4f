"""Colours and letters of the interactive figures, light and dark, and the empty figure that all start from.

The light palette is that of Okabe and Ito (2008), as in `idloop.drawing`, its pale members darkened until a line
stands out from white by 3 to 1 (WCAG 2, 1.4.11); the dark one has the same hues, lightened.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from bokeh.models import BasicTickFormatter, ColumnDataSource, Range1d
from bokeh.models.annotations import BoxAnnotation, Legend, Span
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure
from numpy.typing import ArrayLike

from idloop import drawing
from idloop.reporting.decimation import extremes

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
# Stretches of a figure: more than a wide screen has pixels, so that some zooming shows more.
BUCKETS = 2000
DASHES = ("solid", [10, 4], [3, 3], [10, 3, 3, 3])


@dataclass(frozen=True)
class Theme:
    """Colours by what they stand for; no two of a theme are equal, so that a page may be switched to the other."""

    name: str  # ``light`` or ``dark``
    # Background of the page and of a figure; none is a default of Bokeh's, which is not written to a page
    page: str
    surface: str
    # Words, ticks and less important words, lines of the grid
    text: str
    muted: str
    grid: str
    # The measurement, what was sent in, bands of noise, what was found to be missing, limits
    measured: str
    command: str
    band: str
    found: str
    limit: str
    models: tuple[str, ...]  # models and rivals, in their order

    @property
    def colours(self) -> list[str]:
        """Every colour, in the same order in all themes."""
        plain = [getattr(self, f.name) for f in fields(self) if f.name not in {"name", "models"}]
        return [*plain, *self.models]

    def model(self, index: int) -> dict[str, Any]:
        """Colour and dashes of the line of the model number `index`."""
        return {"color": self.models[index % len(self.models)], "line_dash": DASHES[index % len(DASHES)]}


LIGHT = Theme(
    name="light", page="#f4f5f7", surface="#fefefe", text="#1b2128", muted="#56606b", grid="#e3e6ea",
    measured="#111111", command="#555555", band="#999999", found="#c24a00", limit="#7a1f1f",
    models=("#0072b2", "#d55e00", "#007f5f", "#b0528f", "#946200"),
)  # fmt: skip
DARK = Theme(
    name="dark", page="#0f1318", surface="#171c23", text="#e8ebef", muted="#a3adb8", grid="#2b323b",
    measured="#f2f2f2", command="#b4bac2", band="#7d8894", found="#ff9a4d", limit="#ff8f8f",
    models=("#5cb8f2", "#ff8a4c", "#35cf9f", "#e9a0cb", "#efc04a"),
)  # fmt: skip
THEMES = {theme.name: theme for theme in (LIGHT, DARK)}


def new_figure(
    theme: Theme, x: tuple[str, str | None], y: tuple[str, str | None], *, height: int = 230, **given: Any
) -> figure:
    """Make an empty figure that fills the width of where it is put.

    `x`, `y`: name and unit of each axis; an empty name leaves the axis without a label (a category's ticks are words).
    `height`: of the whole figure [CSS pixels].
    `**given`: for `bokeh.plotting.figure`.
    """
    plot = figure(
        **{
            "height": height,
            "sizing_mode": "stretch_width",
            "tools": "xpan,box_zoom,xwheel_zoom,reset,save",
            "active_drag": "box_zoom",
            "background_fill_color": theme.surface,
            "border_fill_color": theme.surface,
            "outline_line_color": None,
            "min_border_left": 64,
            "min_border_right": 12,
            **given,
        }
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    heading: Any = plot.title
    heading.text_color, heading.text_font, heading.text_font_size = theme.muted, FONT, "11px"
    heading.text_font_style = "normal"
    for axis, (name, unit) in ((plot.xaxis, x), (plot.yaxis, y)):
        axis.axis_label = drawing.label(name, unit) if name else None
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font = axis.major_label_text_font = FONT
        axis.axis_label_text_font_size = "12px"
        axis.major_label_text_font_size = "11px"
        axis.axis_label_text_color = theme.text
        axis.major_label_text_color = theme.muted
        axis.axis_line_color = axis.major_tick_line_color = theme.muted
        axis.minor_tick_line_color = None
        for one in axis:
            if isinstance(one.formatter, BasicTickFormatter):
                one.formatter.power_limit_low = -5  # "0.0008" is shorter than "8.000e-4"
    plot.grid.grid_line_color = theme.grid
    return plot


def add_legend(plot: figure, theme: Theme, entries: list[tuple[str, list[Any]]]) -> None:
    """Write a legend above a figure, one line an entry so that a phone shows it whole; a click hides a line.

    `entries`: list of (str, list of GlyphRenderer). What each says, and for what.
    """
    look: dict[str, Any] = {"padding": 2, "spacing": 0, "margin": 0, "label_height": 14, "glyph_height": 14}
    look |= {"border_line_color": None, "background_fill_color": None, "label_text_color": theme.text}
    look |= {"label_text_font": FONT, "label_text_font_size": "11px"}
    plot.add_layout(Legend(items=entries, click_policy="hide", **look), "above")
    plot.height = int(plot.height or 0) + 16 * len(entries)


def add_heading(plot: figure, text: str) -> None:
    """Write above a figure, which grows by the lines of the text."""
    heading: Any = plot.title
    heading.text = text
    plot.height = int(plot.height or 0) + 18 * (1 + text.count("\n"))


def add_band(plot: figure, low: float, high: float, theme: Theme) -> None:
    """Shade a range of values, such as that of noise."""
    plot.add_layout(BoxAnnotation(bottom=low, top=high, fill_color=theme.band, fill_alpha=0.3, line_color=None))


def add_zero_line(plot: figure, theme: Theme) -> None:
    """Draw where a value is zero."""
    plot.add_layout(Span(location=0.0, dimension="width", line_color=theme.measured, line_width=0.8))


def draw_thinned(
    plot: figure, x: ArrayLike, y: ArrayLike, buckets: int = BUCKETS, *, held: bool = False, **look: Any
) -> GlyphRenderer[Any]:
    """Draw a curve with as few points as it takes; with `held`, each value until the next instant.

    `x` (n,): increasing. `y` (n,): NaN where the curve is interrupted. `buckets`: stretches of equal length in x, of
    which the least and the largest value are drawn.
    """
    place, value = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if len(place) > 2 * buckets + 2:
        place, few = extremes(place, value[:, None], float(place[-1] - place[0]) / buckets)
        value = few[:, 0]
    # In single precision: half the bytes of a page.
    data = source(x=place.astype(np.float32), y=value.astype(np.float32))
    return plot.step("x", "y", source=data, mode="after", **look) if held else plot.line("x", "y", source=data, **look)


def source(**columns: Any) -> ColumnDataSource:
    """Data of a glyph."""
    return ColumnDataSource(data=columns)


def padded(low: float, high: float, share: float = 0.06) -> Range1d:
    """Range that leaves some room about what is drawn."""
    room = share * (high - low) or max(0.1 * abs(high), 1e-12)
    return Range1d(start=low - room, end=high + room)
