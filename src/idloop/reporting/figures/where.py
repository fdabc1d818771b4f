"""Where a model fails: its error along one variable, and over time with the worst stretches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bokeh.models import DataRange1d, FixedTicker, HoverTool, LinearAxis
from bokeh.models.annotations import BoxAnnotation
from bokeh.plotting import figure

from idloop.reporting.breakdowns import (
    MARKED_STRETCHES,
    axis_name,
    bins,
    comparable,
    legend_entry,
    measured_error,
    named_ticks,
)
from idloop.reporting.figures.theme import (
    FONT,
    LIGHT,
    Theme,
    add_heading,
    add_legend,
    add_zero_line,
    draw_thinned,
    new_figure,
    padded,
    source,
)
from idloop.validation.breakdown import Breakdown
from idloop.validation.variables import TITLES
from idloop.validation.where import ErrorMap

LONGEST_TITLE = 44  # letters that a figure on a phone holds in one line


def error_along(maps: Sequence[tuple[str, ErrorMap]], variable: str, theme: Theme = LIGHT) -> figure | None:
    """Draw the error of models along one variable, bin by bin.

    Its mean as a line and the standard deviation about it as a band; along frequency the root mean square of
    every band, along time the error itself.

    Parameters
    ----------
    maps : sequence of (str, ErrorMap)
        Label of each model and where it fails, of one output (or the drive force) on one record.
    variable : str
        One of `idloop.validation.variables.VARIABLES`.

    Returns
    -------
    figure or None
        None where no model has a breakdown along the variable.
    """
    if variable == "time":
        return error_in_time(maps, theme)
    maps = comparable(maps)
    drawn = [(index, b) for index, (_, one) in enumerate(maps) if (b := one.along(variable)) is not None]
    if not drawn:
        return None
    first, unit = drawn[0][1], maps[0][1].unit
    frequency = variable == "frequency"
    plot = new_figure(
        theme,
        axis_name(first),
        ("rms error" if frequency else "mean error ± σ", unit),
        x_axis_type="log" if frequency else "linear",
        **({"y_range": DataRange1d(start=0.0)} if frequency else {}),
        height=230,
    )
    _head(plot, maps[0][1])
    entries = []
    for index, breakdown in drawn:
        glyphs = _draw(plot, breakdown, theme.models[index % len(theme.models)])
        entries.append((legend_entry(maps, index), glyphs))
    if not frequency:
        add_zero_line(plot, theme)
    _name_ticks(plot, first)
    usual = "signal's power there" if frequency else "share of the time"
    tips = [(TITLES[variable], "@name"), ("mean", f"@mean {unit}"), ("rms", f"@rms {unit}")]
    plot.add_tools(HoverTool(tooltips=[*tips, ("share of the squared error", "@error %"), (usual, "@usual %")]))
    if len(drawn) > 1:
        add_legend(plot, theme, entries)
    return plot


def error_in_time(maps: Sequence[tuple[str, ErrorMap]], theme: Theme = LIGHT) -> figure | None:
    """Draw the error of models over time; the worst stretches of the last one are marked and numbered.

    Returns: None without any map.
    """
    if not maps:
        return None
    maps = comparable(maps)
    plot = new_figure(theme, ("time", "s"), ("error", maps[0][1].unit), height=210)
    _head(plot, maps[0][1])
    entries = []
    for index, (_, one) in enumerate(maps):
        colour = theme.models[index % len(theme.models)]
        drawn = draw_thinned(plot, one.time, one.error, color=colour, line_width=1.0)
        entries.append((legend_entry(maps, index), [drawn]))
    add_zero_line(plot, theme)
    numbers: dict[float, str] = {}
    for number, stretch in enumerate(maps[-1][1].loud_stretches[:MARKED_STRETCHES], start=1):
        numbers[0.5 * (stretch.start + stretch.stop)] = str(number)
        marked: dict[str, Any] = {"left": stretch.start, "right": stretch.stop, "line_color": None}
        plot.add_layout(BoxAnnotation(**marked, fill_color=theme.found, fill_alpha=0.22))
    if numbers:  # above the frame, where no curve runs through them
        looks: Any = {"ticker": FixedTicker(ticks=sorted(numbers)), "major_label_overrides": numbers}
        plot.add_layout(
            LinearAxis(
                **looks, axis_line_color=None, major_tick_line_color=None,
                minor_tick_line_color=None, major_label_standoff=-4, major_label_text_font=FONT,
                major_label_text_font_size="12px", major_label_text_color=theme.found,
            ),
            "above",
        )  # fmt: skip
        plot.height = int(plot.height or 0) + 12
    if len(maps) > 1:
        add_legend(plot, theme, entries)
    return plot


def _head(plot: figure, one: ErrorMap) -> None:
    """Write above a figure which error it is of."""
    text = measured_error(one)
    add_heading(plot, text if len(text) <= LONGEST_TITLE else text.replace(": ", ":\n", 1))


def _draw(plot: figure, breakdown: Breakdown, colour: str) -> list[Any]:
    columns = source(**bins(breakdown))
    if breakdown.variable == "frequency":
        bars: dict[str, Any] = {"left": "left", "right": "right", "bottom": 0.0, "top": "rms", "source": columns}
        return [plot.quad(**bars, fill_color=colour, fill_alpha=0.2, line_color=colour, line_width=1.6)]
    band = plot.quad(
        left="left", right="right", bottom="low", top="high", source=columns,
        fill_color=colour, fill_alpha=0.18, line_color=None,
    )  # fmt: skip
    mean = plot.segment(x0="left", x1="right", y0="mean", y1="mean", source=columns, color=colour, line_width=2.2)
    return [band, mean]


def _name_ticks(plot: figure, breakdown: Breakdown) -> None:
    """Words or edges under bins that are no ranges of a plain axis."""
    ticks: Any = named_ticks(breakdown)  # Bokeh asks for a wider type of keys
    if ticks:
        plot.xaxis.ticker = FixedTicker(ticks=list(ticks))
        plot.xaxis.major_label_overrides = ticks
    if breakdown.variable == "since_reversal":
        plot.xaxis.major_label_orientation = 0.9
    elif breakdown.variable == "position" and breakdown.circular:
        plot.x_range = padded(0.0, 360.0, 0.02)
