"""Which figures a report has: on its page, by the name of their place, and as vector files for a paper."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from idloop import drawing
from idloop.reporting.figures.comparison import force_figures, overlay, residual_figures
from idloop.reporting.figures.curves import characteristic_figure, describing_figures, unknown_figure
from idloop.reporting.figures.effects import candidates_figure, ladder_rows
from idloop.reporting.figures.ladder import ladder_figures
from idloop.reporting.figures.next_experiment import experiment_figures
from idloop.reporting.figures.theme import BUCKETS, LIGHT, Theme
from idloop.reporting.figures.where import error_along
from idloop.reporting.frequency_view import frequency_view
from idloop.reporting.plots.comparison import plot_frequency, plot_panels, plot_residual
from idloop.reporting.plots.diagnosis import plot_characteristic, plot_ladder, plot_unknown
from idloop.reporting.plots.where import plot_where
from idloop.reporting.terms import effect_words
from idloop.validation.variables import VARIABLES
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from bokeh.plotting import figure
    from matplotlib.figure import Figure

    from idloop.reporting.page.contents import Contents, Judged
    from idloop.validation import Where


# Records that are drawn; the tables name them all.
MOST_RECORDS = 3
# Bytes of a point in the page (two numbers of four bytes as text), and what all lines over time may take.
_POINT, _ROOM = 11.0, 2.2e6
_FEWEST = 300


def page_figures(contents: Contents, theme: Theme = LIGHT) -> dict[str, list[figure]]:
    """Draw every figure of a report: those that stand below one another, by the name of their place."""
    buckets = _buckets(contents)
    places: dict[str, list[figure]] = {"ladder": ladder_figures(contents.ladder, contents.floor, theme)}
    for name, one in contents.characteristics.items():
        places[f"effect-{name}"] = [characteristic_figure(one, theme)]
    candidates = candidates_figure(ladder_rows(contents.ladder), theme)
    if candidates is not None:
        places["candidates"] = [candidates]
    for index, judged in enumerate(contents.judged[:MOST_RECORDS]):
        forces = [(label, c.force) for label, c in judged.force_rows if c.force is not None]
        if forces:
            places[f"force-{index}"] = force_figures(forces, contents.ladder.model.units.force, theme, buckets=buckets)
        places[f"overlay-{index}"] = overlay(judged.panel, theme, buckets=buckets)
    for name, variable in where_places(contents):
        drawn = error_along(contents.judged[0].maps(name), variable, theme)
        if drawn is not None:
            places[f"where-{name}-{variable}"] = [drawn]
    if contents.ladder.unknown is not None:
        places["unknown"] = [unknown_figure(contents.ladder.unknown, theme)]
    for test in contents.judged[0].residual_tests if contents.judged else ():
        places[f"residual-{test.name}"] = residual_figures(test, theme)
    for index, measured in enumerate(contents.describing):
        places[f"describing-{index}"] = describing_figures(measured, theme)
    if contents.suggestion is not None:
        places["next"] = experiment_figures(contents.suggestion, theme, buckets=buckets)
    return places


def where_places(contents: Contents) -> list[tuple[str, str]]:
    """Output (or drive force) and variable of every figure of where the model fails.

    Returns: of the first error everything; of the others time and what shows most in the first model.
    """
    if not contents.judged:
        return []
    found: list[tuple[str, str]] = []
    maps = contents.judged[0].rows[0][1].where.maps
    for index, one in enumerate(maps):
        # What a curve over the variable explains most of comes first.
        ranked = sorted(one.breakdowns, key=lambda b: -np.nan_to_num(b.follows))
        variables = [b.variable for b in ranked if b.variable != "time"]
        found += [(one.name, v) for v in ("time", *(variables if not index else variables[:1])) if v in VARIABLES]
    return found


def _buckets(contents: Contents) -> int:
    """Stretches of time of a line, so that the page stays small enough to be mailed."""
    lines = 1
    for judged in contents.judged[:MOST_RECORDS]:
        models = len(judged.rows)
        lines += len(judged.record.output_names) * (1 + 2 * models) + 2 + 2 * models
    if contents.suggestion is not None:
        rivals = len(contents.suggestion.rivals)
        lines += (2 + 2 * len(contents.ladder.model.outputs)) * rivals
    return int(np.clip(_ROOM / (2.0 * _POINT * lines), _FEWEST, BUCKETS))


def paper_figures(contents: Contents) -> dict[str, Figure]:
    """Draw the figures for a paper, by the stem of their file."""
    figures = {"ladder": plot_ladder(contents.ladder, contents.floor)}
    for index, judged in enumerate(contents.judged, start=1):
        figures[f"compare_{index}_{judged.use}"] = plot_panels([judged.panel])
        figures[f"where_{index}_{judged.use}"] = plot_where(_where(judged))
    for name, one in contents.characteristics.items():
        figures[f"effect_{name}"] = plot_characteristic(one, effect_words(name))
    if contents.judged:
        figures |= _linear(contents.judged[0])
    if contents.ladder.unknown is not None:
        figures["unknown"] = plot_unknown(contents.ladder.unknown)
    if contents.suggestion is not None:
        from idloop.reporting.plots.suggestion import plot_suggestion

        figures["next"] = plot_suggestion(contents.suggestion)
    return figures


def _linear(judged: Judged) -> dict[str, Figure]:
    """Frequency response and residual tests of the last model on a record."""
    comparison, figures = judged.rows[-1][1], {}
    view = frequency_view(comparison)
    if view is not None:
        for number, name in enumerate(comparison.names):
            figures[f"frequency_{name}"] = plot_frequency(view, number, f"{name}, {judged.title}")
    for test in judged.residual_tests:
        figures[f"residual_{test.name}"] = plot_residual(test, f"one-step residual of {test.name}, {judged.title}")
    return figures


def _where(judged: Judged) -> list[tuple[str, Where]]:
    """Where the models fail; for the drive force also the last one of which it is known."""
    found = [(label, comparison.where) for label, comparison in judged.rows]
    if judged.driven is not None:
        label, comparison = judged.driven
        force = tuple(one for one in comparison.where.maps if one.name == DRIVE_FORCE)
        found.insert(1, (label, replace(comparison.where, maps=force)))
    return found


def save_paper_figures(contents: Contents, folder: Path) -> list[Path]:
    """Write the figures for a paper as SVG into a folder, which is made; IdloopError where one cannot be written."""
    return [drawing.save(figure, folder / f"{stem}.svg") for stem, figure in paper_figures(contents).items()]
