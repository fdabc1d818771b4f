"""What `fit` and `compare` both say about a model beside a record: table, verdicts, figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._common import number, print_table

if TYPE_CHECKING:
    from idloop.reporting.plots.comparison import Panel
    from idloop.validation import Comparison
    from idloop.validation.where import ErrorMap

# Of what stands out: so much of the first error, the drive force where there is one, and of every further one.
_FIRST, _FURTHER = 2, 1
# FIT of a free run below which a model is worth a diagnosis, and below which it may not move by the command at all [%].
_GOOD, _HOPELESS = 90.0, 20.0


def percent(value: float) -> str:
    """Text of a percentage: two decimals, so that 99.99 and 100 differ."""
    return f"{value:.2f}" if math.isfinite(value) else "-"


def print_comparisons(rows: Iterable[tuple[str, Comparison]]) -> None:
    """Print the measures of every output, one line each.

    Parameters
    ----------
    rows : iterable of (str, Comparison)
        What the first column says, and the comparison.
    """
    known = list(rows)
    steps = known[0][1].steps
    table = []
    for label, comparison in known:
        measures = zip(comparison.names, comparison.model.outputs, strict=True)
        for index, (name, output) in enumerate(measures):
            force = comparison.force
            table.append(
                (
                    label,
                    comparison.record.name,
                    name,
                    percent(comparison.fit[name]),
                    number(comparison.nrmse[name]),
                    number(comparison.rmse[name]),
                    output.unit,
                    percent(comparison.fit_ahead[name]),
                    # One force for the whole record: said once.
                    "-" if force is None or index else percent(100 * force.relative),
                )
            )
    header = ("", "record", "output", "FIT %", "NRMSE", "RMSE", "unit", f"FIT % {steps} ahead", "force error %")
    print_table(header, table)
    for reason in dict.fromkeys(comparison.no_force for _, comparison in known if comparison.no_force):
        click.echo(f"no force error: {reason}")


def hopeless(comparisons: Iterable[Comparison]) -> bool:
    """Whether a free run is that far off in every output of some record."""
    return any(max(one.fit.values()) < _HOPELESS for one in comparisons)


def print_hint(rows: Iterable[tuple[str, Comparison]]) -> None:
    """Say where to go on when a free run misses more of an output than a good model does."""
    worst = min(
        ((fit, name, comparison.record.name) for _, comparison in rows for name, fit in comparison.fit.items()),
        default=(math.inf, "", ""),
    )
    if worst[0] < _GOOD:
        click.echo(
            f"the free run misses {worst[1]} of {worst[2]} (FIT {percent(worst[0])} %): idloop diagnose MODEL BAG..."
            " names the physical effect that is missing"
        )


def print_verdicts(rows: Iterable[tuple[str, Comparison]]) -> None:
    """Print what the one-step residual still holds, and when the model fails."""
    from idloop.reporting.remains import remainders

    for label, comparison in rows:
        for test in (one.test for one in remainders([comparison])):
            white = "white" if test.white else "not white"
            free = f" (p {test.cross_p:.2g})" if test.told else ""
            click.echo(
                f"{label}: residual of {test.name} is {white} (Ljung-Box p {test.ljung_box_p:.2g})"
                f" and {test.freedom}{free}"
            )
        for name, regions in comparison.share.items():
            parts = (
                f"{region} {100 * part['error']:.0f} % (of time {100 * part['time']:.0f} %)"
                for region, part in regions.items()
            )
            click.echo(f"{label}: squared error of {name}: {', '.join(parts)}")


def print_where(rows: Iterable[tuple[str, Comparison]]) -> None:
    """Print where each model fails: what stands out, a few lines for the drive force and every output."""
    for label, comparison in rows:
        click.echo(f"{label}: where the error of {comparison.record.name} falls")
        for line in comparison.where.lines():
            click.echo(f"  {line}")


def print_brief(rows: Iterable[tuple[str, Comparison]]) -> None:
    """Print the most telling of verdicts and of where each model fails, a few lines for each model."""
    for label, comparison in rows:
        click.echo(f"{label}, {comparison.record.name}:")
        verdicts = brief_verdicts(comparison)
        if verdicts:
            click.echo(f"  one-step residual: {verdicts}")
        for index, one in enumerate(comparison.where.maps):
            for line in brief_map(one, _FIRST if index == 0 else _FURTHER):
                click.echo(f"  {line}")


def brief_verdicts(comparison: Comparison) -> str:
    """What the one-step residuals still hold, in one line; outputs of which the same is said together."""
    from idloop.reporting.remains import remainders

    said: dict[str, list[str]] = {}
    for test in (one.test for one in remainders([comparison])):
        white = "white" if test.white else "not white"
        text = f"{white}, {test.freedom}"
        said.setdefault(text, []).append(test.name)
    return "; ".join(f"{' and '.join(names)} {text}" for text, names in said.items())


def brief_map(one: ErrorMap, most: int) -> list[str]:
    """How large an error is, along what it falls most, what it follows, and its worst stretch."""
    head, *rest = one.lines()
    shown = [head]
    # As `lines` writes them: why, what stands out (most first), what does not, what it follows, the worst stretches.
    rest = rest[1:] if one.why else rest
    shown += rest[: min(most, sum(breakdown.stands_out for breakdown in one.breakdowns))]
    if most == _FIRST:
        shown += [line for line in rest if line.startswith("  a curve over one variable")]
        shown += [f"  worst: {stretch.line()}" for stretch in one.loud_stretches[:1]]
    return shown


def save_where(rows: Sequence[tuple[str, Comparison]], path: Path) -> None:
    """Write the figure of where the models fail, all on one record."""
    from idloop.drawing import save
    from idloop.reporting.plots.where import plot_where

    save(plot_where([(label, comparison.where) for label, comparison in rows]), path)


def make_panel(title: str, rows: Sequence[tuple[str, Comparison]]) -> Panel:
    """Column of the comparison figure: one record and the free run of each model.

    Parameters
    ----------
    title : str
        Above the column.
    rows : sequence of (str, Comparison)
        Label of each model and its comparison, all with the same record.
    """
    from idloop.reporting.plots import comparison

    return comparison.make_panel(title, rows)


def save_figure(panels: Sequence[Panel], comparison: Comparison, path: Path) -> None:
    """Write the comparison figure of records that have the outputs of `comparison`."""
    from idloop.drawing import save
    from idloop.reporting.plots.comparison import plot_comparison

    record = comparison.record
    save(plot_comparison(panels, record.output_names, record.output_units, record.input_name, record.input_unit), path)
