"""Curves over one variable: a fitted effect on the data that ask for it, the force that no effect explains, gains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.models import FixedTicker
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, add_zero_line, new_figure, source

if TYPE_CHECKING:
    from idloop.diagnosis import UnknownStructure
    from idloop.estimation.describing_functions import MeasuredDescribingFunction
    from idloop.validation.characteristic import Characteristic


def characteristic_figure(one: Characteristic, theme: Theme = LIGHT) -> figure:
    """Draw the data along the motion as dots, their mean and deviation in each bin, and the fitted effect as a line."""
    plot = new_figure(theme, (one.variable, one.unit), (one.quantity, one.quantity_unit), height=260)
    dots = plot.scatter(
        "x", "y", source=source(x=one.x, y=one.y), size=3, fill_color=theme.band, fill_alpha=0.45, line_color=None
    )
    entries: list[tuple[str, list[Any]]] = [("left by the model without it", [dots])]
    if len(one.centre):
        columns = source(x=one.centre, y=one.mean, low=one.mean - one.band, high=one.mean + one.band)
        means = [
            plot.segment("x", "low", "x", "high", source=columns, color=theme.measured, line_width=2.0),
            plot.scatter("x", "y", source=columns, color=theme.measured, size=6),
        ]
        entries.append(("mean ± standard deviation", means))
    curve = plot.line("x", "y", source=source(x=one.curve_x, y=one.curve_y), color=theme.found, line_width=2.8)
    entries.append(("the fitted effect", [curve]))
    add_zero_line(plot, theme)
    if one.circular:
        plot.xaxis.ticker = FixedTicker(ticks=[0, 90, 180, 270, 360])
    add_legend(plot, theme, entries)
    return plot


def unknown_figure(unknown: UnknownStructure, theme: Theme = LIGHT) -> figure:
    """Draw the force (or command) that no effect of the catalogue explains, with its band."""
    at, force, half = (np.asarray(v, dtype=float) for v in (unknown.at, unknown.force, unknown.band))
    plot = new_figure(theme, (unknown.along, unknown.unit), (unknown.what, unknown.force_unit), height=240)
    data = source(x=at, y=force, low=force - half, high=force + half)
    band = plot.varea("x", "low", "high", source=data, fill_color=theme.band, fill_alpha=0.35)
    line = plot.line("x", "y", source=data, color=theme.found, line_width=2.2)
    add_zero_line(plot, theme)
    add_legend(plot, theme, [("estimate", [line]), ("95 % band", [band])])
    return plot


def describing_figures(measured: MeasuredDescribingFunction, theme: Theme = LIGHT) -> list[figure]:
    """Draw a gain for a sine, one line for each frequency; over the frequency where it has more than amplitudes.

    Returns: size with its confidence, phase, distortion.
    """
    # Amplitudes that were meant to be equal are measured a little apart.
    amplitudes = np.unique(np.round(20.0 * np.log10(measured.amplitude))).size
    lines = list(measured.lines())
    over_frequency = amplitudes < len(lines)
    x = ("frequency", "Hz") if over_frequency else ("amplitude", measured.input_unit)
    if over_frequency:
        lines = [(float("nan"), np.argsort(measured.frequency, kind="stable"))]
    known = bool(measured.input_unit and measured.output_unit)
    unit = f"{measured.output_unit}/{measured.input_unit}" if known else None
    scales: dict[str, Any] = {"x_axis_type": "log" if over_frequency else "linear"}
    size = new_figure(theme, x, ("size of N", unit), height=218, **scales)
    phase = new_figure(theme, x, ("phase of N", "°"), height=188, x_range=size.x_range, **scales)
    distortion = new_figure(theme, x, ("distortion", "%"), height=170, x_range=size.x_range, **scales)
    entries = []
    for index, (frequency, places) in enumerate(lines):
        gain, radius = measured.gain[places], np.nan_to_num(measured.radius[places])
        columns = source(
            x=(measured.frequency if over_frequency else measured.amplitude)[places],
            size=np.abs(gain), low=np.maximum(np.abs(gain) - radius, 0.0), high=np.abs(gain) + radius,
            phase=np.degrees(np.angle(gain)), distortion=100.0 * measured.distortion[places],
        )  # fmt: skip
        look = theme.model(index)
        drawn: list[Any] = [size.segment("x", "low", "x", "high", source=columns, color=look["color"])]
        for plot, name in ((size, "size"), (phase, "phase"), (distortion, "distortion")):
            drawn += [
                plot.line("x", name, source=columns, **look),
                plot.scatter("x", name, source=columns, color=look["color"], size=6),
            ]
        label = measured.name if np.isnan(frequency) else f"{measured.name}, {frequency:.4g} Hz"
        entries.append((label, drawn))
    add_legend(size, theme, entries)
    return [size, phase, distortion]
