"""`idloop fit`: estimates a model's free parameters from bags, with intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._common import (
    BAG,
    MODEL,
    ListOptionCommand,
    apply_options,
    json_option,
    log_grades,
    log_written,
    model_options,
    plot_option,
    print_found,
    read_fitted_and_unseen,
    save_plot,
)
from idloop.cli._diagnosis import CRITERIA
from idloop.cli._places import OUTPUT_FILE, force_option
from idloop.cli._progress import progress, quiet_option
from idloop.output_files import write_text

if TYPE_CHECKING:
    from idloop.physics import Model

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

    MODEL is a preset or a model file; a parameter is free where the file writes it as a mapping. What `idloop inspect`
    finds wrong with a bag is said in one line before the fit.
    """
    model = apply_options(model, settings, effects)
    train, validation = read_fitted_and_unseen(bags, validate, model)

    from idloop.api.fit import fit

    grades = log_grades((*bags, *validate), model, (*train, *validation))
    with progress(f"fitting {model.name}") as update:
        found = fit(model, train, validation, criterion=criterion, progress=update)
    found = replace(found, unusable=any(one.useless for one in grades[: len(bags)]))
    if output is not None:
        write_text(output, found.model.to_yaml())
    save_plot(found.plot, plot)
    inspected = [one.to_dict() for one in grades]
    print_found(found, as_json=as_json, inspections=inspected, output=output, plot=plot)
    log_written(output, plot)
