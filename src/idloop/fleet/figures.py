"""Figures of a fleet: a heat map of joints over dates, and every parameter of every kind over time with its bands."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import Components
from idloop.fleet.words import day_text, display, kind_text

if TYPE_CHECKING:
    from bokeh.plotting import figure
    from matplotlib.figure import Figure


MOST_ROWS = 150  # joints in the heat map
FRAME = "diagnosed"  # name of the frames in it
_MOST_LINES = 5
Z95 = 1.959963984540054
_BANDS = ((2.5, 97.5), (16.0, 84.0))
_COLOURS = (1.5, 6.0)  # standard deviations of the palest colour and of the strongest one
_DAY = 86_400_000.0  # [ms]
_AXES = {FORCE_ERROR: "force error"}


def deviations(components: Sequence[Components]) -> tuple[list[tuple[str, str]], Array, Array, NDArray[np.str_]]:
    """Largest deviation of each joint and date from its kind, in standard deviations.

    Returns `names`: robot and joint; the largest deviations first. `days` (d,). `size` (joints, d): NaN without a
    recording. `parameter` (joints, d).
    """
    names = sorted({name for parts in components for name in parts.series.names})
    days = np.unique(np.concatenate([parts.series.days for parts in components])) if components else np.zeros(0)
    size = np.full((len(names), len(days)), np.nan)
    parameter = np.full(size.shape, "", dtype=object)
    row = {name: place for place, name in enumerate(names)}
    for parts in components:
        rows = np.array([row[name] for name in parts.series.names])
        place = np.ix_(rows, np.searchsorted(days, parts.series.days))
        own = np.abs(parts.left - parts.mean) / np.sqrt(np.maximum(parts.unit_deviation**2 + parts.total, 1e-300))
        larger = np.isfinite(own) & ~(size[place] >= own)
        size[place] = np.where(larger, own, size[place])
        parameter[place] = np.where(larger, parts.series.parameter, parameter[place])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        order = np.argsort(-np.nan_to_num(np.nanmax(size, axis=1))) if len(days) else np.arange(len(names))
    return [names[k] for k in order], days, size[order], parameter[order]


def heat_map(
    components: Sequence[Components],
    reports: Mapping[tuple[str, str], str],
    framed: Collection[tuple[str, str]] = (),
) -> list[figure]:
    """Draw the joints that deviate most; a click on one opens its report."""
    from bokeh.models import ColumnDataSource, HoverTool, OpenURL, TapTool
    from bokeh.models.annotations import ColorBar
    from bokeh.transform import linear_cmap

    from idloop.reporting.figures.theme import FONT, LIGHT, new_figure

    names, days, size, parameter = deviations(components)
    names, size, parameter = names[:MOST_ROWS], size[:MOST_ROWS], parameter[:MOST_ROWS]
    labels, dates = [" ".join(one) for one in names], [day_text(one) for one in days]
    size_of: dict[str, Any] = {"height": 150 + 14 * len(labels), "min_border_left": 140}
    plot = new_figure(LIGHT, ("", None), ("", None), x_range=dates, y_range=labels[::-1], **size_of)
    plot.xaxis.major_label_orientation = 1.2
    plot.grid.visible = False
    rows, columns = np.nonzero(np.isfinite(size))
    boxes = [label for label, name in zip(labels, names, strict=True) if name in framed]
    data: dict[str, Any] = {
        "date": [dates[k] for k in columns], "joint": [labels[k] for k in rows],
        "size": np.round(size[rows, columns], 2), "parameter": parameter[rows, columns].tolist(),
        "report": [reports[names[k]] for k in rows],
        "diagnosed": ["yes" if names[k] in framed else "no" for k in rows],
    }  # fmt: skip
    fill = linear_cmap("size", _palette(), *_COLOURS)
    cells = plot.rect(
        "date", "joint", width=1.0, height=0.9, source=ColumnDataSource(data), line_color=None, fill_color=fill,
        nonselection_fill_alpha=1.0,
    )  # fmt: skip
    # A light line within a dark one stands out from any cell, on a light and on a dark page.
    for colour, width in ((LIGHT.text, 5.0), (LIGHT.surface, 2.0)):
        look = {"fill_color": None, "line_color": colour, "line_width": width}
        plot.hbar(boxes, left=0.0, right=len(dates), height=0.9, name=FRAME, **look)
    words = {"font": FONT, "font_size": "11px", "font_style": "normal", "color": LIGHT.muted}
    texts: dict[str, Any] = {
        f"{part}_text_{key}": one for part in ("title", "major_label") for key, one in words.items()
    }
    title = "deviation from the kind, in standard deviations; the ends of the scale include what is beyond them"
    bar = ColorBar(color_mapper=fill["transform"], title=title, height=8, background_fill_color=LIGHT.surface, **texts)
    plot.add_layout(bar, "above")
    tips = [
        ("joint", "@joint"), ("date", "@date"), ("parameter", "@parameter"),
        ("from its kind", "@size standard deviations"), ("diagnosed", "@diagnosed"), ("report", "click"),
    ]  # fmt: skip
    tools = HoverTool(tooltips=tips, renderers=[cells]), TapTool(callback=OpenURL(url="@report"), renderers=[cells])
    plot.add_tools(*tools)
    return [plot]


def _palette() -> list[str]:
    """From a pale blue to red, readable on a light and on a dark page."""
    from bokeh.palettes import interp_palette

    return list(interp_palette(("#c6dbef", "#6baed6", "#fdae61", "#d7301f", "#7f0000"), 64))


def bands(parts: Components) -> tuple[Array, list[tuple[Array, Array]]]:
    """Median of a kind's units by date, and the bands that hold 95 % and 68 % of them, as percentiles, (d,) each.

    Of those units that its mean describes, too.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        value = display(*_named(parts))[0] * parts.series.natural(parts.series.value[parts.kept])
        ends = [tuple(np.nanpercentile(value, pair, axis=0)) for pair in _BANDS]
        return np.nanmedian(value, axis=0), [(low, high) for low, high in ends]


def label_of(parts: Components) -> tuple[str, str]:
    """Name and unit of an axis."""
    name, unit = _named(parts)
    return _AXES.get(name, name), display(name, unit)[1]


def _named(parts: Components) -> tuple[str, str]:
    return parts.series.parameter, parts.series.unit


def trend(parts: Components, shown: Sequence[tuple[str, str]], chosen: str = "") -> list[figure]:
    """Draw a parameter of a kind over time: bands of the kind, and a line for each joint that is shown.

    With `chosen` there is one more line, whose points the page fills in: its source has that name.
    """
    from bokeh.models import ColumnDataSource, HoverTool

    from idloop.reporting.figures.theme import LIGHT, add_legend, new_figure

    series = parts.series
    time = series.days * _DAY
    middle, ends = bands(parts)
    plot = new_figure(LIGHT, ("", None), label_of(parts), height=240, x_axis_type="datetime")
    drawn = [plot.varea(time, low, high, fill_color=LIGHT.band, fill_alpha=0.25) for low, high in ends]
    line = plot.line(time, middle, color=LIGHT.measured, line_width=2)
    left_out = int(np.sum(~parts.kept))
    without = f", without {left_out} too far off" if left_out else ""
    entries: list[tuple[str, list[Any]]] = [(f"median, 68 % and 95 % of the joints{without}", [line, *drawn])]
    factor, _ = display(*_named(parts))
    sources = {"this joint": ColumnDataSource({"x": [], "y": [], "low": [], "high": []}, name=chosen)} if chosen else {}
    for name in [one for one in shown if one in series.names][:_MOST_LINES]:
        place = series.names.index(name)
        known = np.isfinite(series.value[place])
        y = factor * series.natural(series.value[place][known])
        reach = Z95 * factor * np.sqrt(series.variance[place][known])
        low = np.maximum(y - reach, series.least)
        sources[" ".join(name)] = ColumnDataSource({"x": time[known], "y": y, "low": low, "high": y + reach})
    # The errors of an error of the force are not known.
    bars = series.parameter != FORCE_ERROR
    unit = label_of(parts)[1]
    points: list[Any] = []
    for number, (words, source) in enumerate(sources.items()):
        look = LIGHT.model(number)
        points.append(plot.scatter("x", "y", source=source, color=look["color"], size=4, name=words))
        own = [
            plot.line("x", "y", source=source, line_width=1.6, **look), points[-1],
            plot.segment("x", "low", "x", "high", source=source, color=look["color"], line_width=0.8),
        ]  # fmt: skip
        entries.append((f"{words}, bars: 95 % interval of the fit" if bars else words, own))
    tips = [("", "$name"), ("date", "@x{%F}"), (series.parameter, f"@y {unit}")]
    tips += [("95 % interval of the fit", f"@low .. @high {unit}")] if bars else []
    if points:
        plot.add_tools(HoverTool(tooltips=tips, formatters={"@x": "datetime"}, renderers=points))
    add_legend(plot, LIGHT, entries)
    return [plot]


def plot_fleet(components: Sequence[Components]) -> Figure:
    """Draw every parameter of every kind over time, for paper."""
    from matplotlib.figure import Figure

    from idloop import drawing

    kinds = [one.series.kind for one in components]
    with drawing.styled():
        figure = Figure(figsize=(9.0, 2.0 * max(len(components), 1) + 0.5), layout="constrained")
        rows = figure.subplots(max(len(components), 1), 1, squeeze=False)
        for (axis,), parts in zip(rows, components, strict=False):
            middle, ends = bands(parts)
            time = parts.series.days.astype("datetime64[D]")
            for low, high in ends:
                axis.fill_between(time, low, high, color="0.6", alpha=0.25, linewidth=0.0)
            axis.plot(time, middle, color=drawing.MEASURED, linewidth=1.4)
            kind = kind_text(parts.series.kind, kinds)
            joints = f"{int(parts.kept.sum())} of {len(parts.series.names)} joints"
            title = f"{kind}: median, 68 % and 95 % of {joints}"
            axis.set_title(title, fontsize="small", loc="left")
            axis.set_ylabel(drawing.label(*label_of(parts)))
    return figure
