"""Measured describing functions: size, phase and distortion of the gain for a sine, over its amplitude or frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, source

if TYPE_CHECKING:
    from idloop.estimation.describing_functions import MeasuredDescribingFunction


def describing_figures(measured: MeasuredDescribingFunction, theme: Theme = LIGHT) -> list[figure]:
    """Draw it, one line for each frequency; over the frequency where there are more of them than amplitudes.

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
