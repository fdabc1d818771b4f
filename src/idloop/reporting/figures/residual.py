"""Correlations of what a model leaves over: with itself, and with the input."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_zero_line, new_figure, source
from idloop.validation.residual import ResidualTest


def residual_figures(test: ResidualTest, theme: Theme = LIGHT) -> list[figure]:
    """Draw the tests of one output's one-step residual.

    Returns: autocorrelation, correlation with the input; the band holds 99 % of the values of a residual that is noise.
    """
    return [
        _stems(theme, "autocorrelation", test.lag, test.autocorrelation, test.autocorrelation_band, test.white),
        _stems(
            theme,
            f"correlation with {test.against}",
            test.cross_lag,
            test.cross_correlation,
            test.cross_correlation_band,
            test.input_free,
        ),
    ]


def _stems(theme: Theme, name: str, lag: Any, value: Any, half: Any, passed: bool) -> figure:
    # The whole name along the axis would be longer than the axis.
    plot = new_figure(theme, ("lag", "samples"), ("correlation", "-"), height=205, title=name)
    data = source(x=lag, y=value, low=-np.asarray(half), high=np.asarray(half))
    colour = theme.models[0] if passed else theme.found
    plot.varea("x", "low", "high", source=data, fill_color=theme.band, fill_alpha=0.3)
    plot.segment("x", 0, "x", "y", source=data, color=colour, line_width=2.0)
    plot.scatter("x", "y", source=data, color=colour, size=4)
    add_zero_line(plot, theme)
    return plot
