"""`idloop fit`: estimates a model's free parameters from bags, with intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._assessment import hopeless, make_panel, print_comparisons, print_hint, save_figure
from idloop.cli._common import (
    BAG,
    MODEL,
    ListOptionCommand,
    apply_options,
    json_option,
    log,
    model_options,
    plot_option,
    print_json,
    read_fitted_and_unseen,
)
from idloop.cli._places import OUTPUT_FILE, force_option, write_text
from idloop.cli._progress import part, progress, quiet_option

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison

CRITERIA = ("auto", "prediction", "simulation", "force")


def compare_all(
    model: Model, train: list[Record], validation: list[Record]
) -> tuple[list[Comparison], list[Comparison]]:
    """Compare the fitted model with every record."""
    from idloop.validation import compare

    return [compare(model, record) for record in train], [compare(model, record) for record in validation]


EXAMPLE = """\b
Example:
  idloop fit emps bags/train --effect coulomb_friction@axis \\
    --validate bags/pulses --output fitted.yaml --plot fit.png
"""


@click.command(cls=ListOptionCommand, epilog=EXAMPLE)
@click.argument("model", type=MODEL)
@click.argument("bags", type=BAG, nargs=-1, required=True, metavar="BAG...")
@click.option("--validate", type=BAG, multiple=True, metavar="BAG...", help="Bags that the fit does not see.")
@click.option(
    "--criterion",
    type=click.Choice(CRITERIA),
    default="auto",
    show_default=True,
    help="What is made small: one-step errors, free-run errors or the unexplained drive force.",
)
@model_options
@click.option("--output", type=OUTPUT_FILE, metavar="FITTED.yaml", help="Write the fitted model file.")
@force_option("Overwrite the file of --output.")
@plot_option
@quiet_option
@json_option
def command(
    model: Model,
    bags: tuple[Path, ...],
    *,
    validate: tuple[Path, ...],
    criterion: str,
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    output: Path | None,
    force: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Estimate the free parameters of MODEL from every BAG together.

    MODEL is a preset or a model file; a parameter is free where the file writes it as a mapping.
    """
    model = apply_options(model, settings, effects)
    train, validation = read_fitted_and_unseen(bags, validate, model)

    from idloop.estimation import fit
    from idloop.reporting.use import FITTED, UNSEEN

    with progress(f"fitting {model.name}") as update:
        result = fit(model, train, criterion=criterion, progress=part(update, 0.0, 0.9))
        update(0.9, "comparing")
        on_train, on_validation = compare_all(result.model, train, validation)
        unrelated = ""
        if hopeless(on_train):
            from idloop.diagnosis.screening.command_response import response_of

            update(0.95, "looking whether the motion follows the command")
            unrelated = response_of(model, train).text
            if unrelated:
                result = replace(result, warnings=(*result.warnings, unrelated))

    if output is not None:
        write_text(output, result.model.to_yaml())
    labelled = [(FITTED, c) for c in on_train] + [(UNSEEN, c) for c in on_validation]
    if plot is not None:
        panels = [make_panel(f"{label}: {c.record.name}", [(model.name, c)]) for label, c in labelled]
        save_figure(panels, on_train[0], plot)
    if as_json:
        print_json(
            {
                "schema": "idloop/fit/1",
                **result.to_dict(),
                "train": [c.to_dict() for c in on_train],
                "validation": [c.to_dict() for c in on_validation],
                "output": output,
                "plot": plot,
            }
        )
    else:
        click.echo(result.summary())
        click.echo()
        print_comparisons(labelled)
        if not unrelated:
            print_hint(labelled)
    for written in (output, plot):
        if written is not None:
            log(f"written: {written}")
