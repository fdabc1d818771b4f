"""Which figures stand on the page of a report, by the name of their place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop.reporting.figures.candidates import candidates_figure, ladder_rows
from idloop.reporting.figures.characteristic import characteristic_figure, unknown_figure
from idloop.reporting.figures.comparison import force_figures, overlay
from idloop.reporting.figures.describing import describing_figures
from idloop.reporting.figures.ladder import ladder_figures
from idloop.reporting.figures.next_experiment import experiment_figures
from idloop.reporting.figures.residual import residual_figures
from idloop.reporting.figures.theme import LIGHT, Theme
from idloop.reporting.figures.thinning import BUCKETS
from idloop.reporting.figures.where import error_along
from idloop.reporting.plots.comparison import Panel, make_panel
from idloop.reporting.residual_findings import FEWEST_FOR_TESTS
from idloop.validation.variables import VARIABLES
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from bokeh.plotting import figure

    from idloop.reporting.page.contents import Contents, Judged
    from idloop.validation.where import ErrorMap

# Records that are drawn; the tables name them all.
MOST_RECORDS = 3
# Bytes of a point in the page (two numbers of four bytes as text), and what all lines over time may take.
_POINT, _ROOM = 11.0, 2.2e6
_FEWEST = 300


def page_figures(contents: Contents, theme: Theme = LIGHT) -> dict[str, list[figure]]:
    """Draw every figure of a report.

    Returns: figures that stand below one another, by the name of their place.
    """
    buckets = _buckets(contents)
    places: dict[str, list[figure]] = {"ladder": ladder_figures(contents.ladder, contents.floor, theme)}
    for name, one in contents.characteristics.items():
        places[effect_place(name)] = [characteristic_figure(one, theme)]
    candidates = candidates_figure(ladder_rows(contents.ladder), theme)
    if candidates is not None:
        places["candidates"] = [candidates]
    for index, judged in enumerate(contents.judged[:MOST_RECORDS]):
        record = judged.record
        forces = [(label, c.force) for label, c in judged.force_rows if c.force is not None]
        if forces:
            places[f"force-{index}"] = force_figures(forces, contents.ladder.model.units.force, theme, buckets=buckets)
        places[f"overlay-{index}"] = overlay(
            panel_of(judged), record.output_names, record.output_units, record.input_name, record.input_unit,
            theme, buckets=buckets,
        )  # fmt: skip
    for name, variable in where_places(contents):
        maps = maps_of(contents.judged[0], name)
        drawn = error_along(maps, variable, theme)
        if drawn is not None:
            places[where_place(name, variable)] = [drawn]
    if contents.ladder.unknown is not None:
        places["unknown"] = [unknown_figure(contents.ladder.unknown, theme)]
    if contents.judged and len(contents.judged[0].record.time) >= FEWEST_FOR_TESTS:
        for test in contents.judged[0].rows[-1][1].residual_tests():
            places[f"residual-{test.name}"] = residual_figures(test, theme)
    for index, measured in enumerate(contents.describing):
        places[f"describing-{index}"] = describing_figures(measured, theme)
    if contents.suggestion is not None:
        places["next"] = experiment_figures(contents.suggestion, theme, buckets=buckets)
    return places


def maps_of(judged: Judged, name: str) -> list[tuple[str, ErrorMap]]:
    """Label and error map of the first and the last model, of one output or the drive force, where known."""
    rows = judged.force_rows if name == DRIVE_FORCE else judged.rows
    return [(label, one) for label, c in rows for one in c.where.maps if one.name == name]


def effect_place(name: str) -> str:
    """Place of an effect's characteristic."""
    return f"effect-{name}"


def where_place(name: str, variable: str) -> str:
    """Place of the error of an output along a variable."""
    return f"where-{name}-{variable}"


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


def panel_of(judged: Judged) -> Panel:
    """Measured and modelled outputs of one record, as the figures of comparisons take them."""
    return make_panel(judged.title, judged.rows)


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
