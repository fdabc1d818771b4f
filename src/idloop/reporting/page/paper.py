"""The figures of a run for a paper: one vector file each, in the look of all printed figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from idloop import drawing
from idloop.reporting.frequency_view import frequency_view
from idloop.reporting.page.page_figures import panel_of
from idloop.reporting.plots.comparison import plot_panels
from idloop.reporting.plots.diagnosis import plot_characteristic
from idloop.reporting.plots.ladder import plot_ladder, plot_unknown
from idloop.reporting.plots.linear import plot_frequency, plot_residual
from idloop.reporting.plots.where import plot_where
from idloop.reporting.residual_findings import FEWEST_FOR_TESTS
from idloop.reporting.terms import effect_words
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.reporting.page.contents import Contents, Judged
    from idloop.validation import Where


def paper_figures(contents: Contents) -> dict[str, Figure]:
    """Draw them.

    Returns: figures by the stem of their file.
    """
    figures = {"ladder": plot_ladder(contents.ladder, contents.floor)}
    for index, judged in enumerate(contents.judged, start=1):
        figures[f"compare_{index}_{judged.use}"] = plot_panels([panel_of(judged)], judged.record)
        figures[f"where_{index}_{judged.use}"] = plot_where(_where(judged))
    for name, one in contents.characteristics.items():
        figures[f"effect_{name}"] = plot_characteristic(one, effect_words(name))
    figures |= _linear(contents)
    if contents.ladder.unknown is not None:
        figures["unknown"] = plot_unknown(contents.ladder.unknown)
    if contents.suggestion is not None:
        from idloop.reporting.plots.suggestion import plot_suggestion

        figures["next"] = plot_suggestion(contents.suggestion)
    return figures


def _linear(contents: Contents) -> dict[str, Figure]:
    """Frequency response and residual tests of the last model, on the record that is judged first."""
    if not contents.judged:
        return {}
    judged = contents.judged[0]
    comparison, figures = judged.rows[-1][1], {}
    view = frequency_view(comparison)
    if view is not None:
        for number, name in enumerate(comparison.names):
            figures[f"frequency_{name}"] = plot_frequency(view, number, f"{name}, {judged.title}")
    tests = comparison.residual_tests() if len(comparison.time) >= FEWEST_FOR_TESTS else []
    for test in tests:
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
    """Write them as SVG.

    `folder`: is made where it is not there.
    Raises IdloopError: a file cannot be written.
    """
    return [drawing.save(figure, folder / f"{stem}.svg") for stem, figure in paper_figures(contents).items()]
