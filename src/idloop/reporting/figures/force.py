"""Drive side: the force that was applied, the force that each model needs for the measured motion, their difference."""

from __future__ import annotations

from collections.abc import Sequence

from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, add_legend, new_figure, padded, source
from idloop.reporting.figures.thinning import BUCKETS, thinned
from idloop.validation.drive import ForceError
from idloop.validation.words import short


def force_figures(
    models: Sequence[tuple[str, ForceError]], unit: str, theme: Theme = LIGHT, *, buckets: int = BUCKETS
) -> list[figure]:
    """Draw the drive side of models on one record.

    Parameters
    ----------
    models : sequence of (str, ForceError)
        Label of each model and its drive side.
    unit : str
        Of the force.
    buckets : int
        As for `idloop.reporting.figures.thinning.kept`.

    Returns
    -------
    list of figure
        Forces, then what each model misses. Models that change the command apply another force: each is drawn as
        what was applied by the first less its own error.
    """
    if not models:
        return []
    first = models[0][1]
    span = padded(float(first.time[0]), float(first.time[-1]), 0.01)
    time = ("time", "s")
    top = new_figure(theme, time, ("drive force", unit), x_range=span, height=258)
    below = new_figure(theme, time, ("difference", unit), x_range=span, height=190)
    below.add_layout(Span(location=0.0, dimension="width", line_color=theme.measured, line_width=0.8))
    x, y = thinned(first.time, first.applied, buckets)
    applied = top.line("x", "y", source=source(x=x, y=y), color=theme.measured, line_width=2.4)
    entries = [("applied", [applied])]
    for index, (label, one) in enumerate(models):
        look = {**theme.model(index), "line_width": 1.4}
        error = one.applied - one.required
        same = len(one.time) == len(first.time)
        x, y = thinned(one.time, (first.applied if same else one.applied) - error, buckets)
        needed = top.line("x", "y", source=source(x=x, y=y), **look)
        x, y = thinned(one.time, error, buckets)
        missed = below.line("x", "y", source=source(x=x, y=y), **look)
        entries.append((f"needed by {label} (error {short(100.0 * one.relative)} %)", [needed, missed]))
    add_legend(top, theme, entries)
    return [top, below]
