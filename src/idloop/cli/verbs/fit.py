"""`idloop fit`: estimates a model's free parameters from bags, with intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress

if TYPE_CHECKING:
    from idloop.physics import Model

EXAMPLE = """\b
Example:
  idloop fit emps bags/train --effect coulomb_friction@axis \\
    --validate bags/pulses --output fitted.yaml --plot fit.png
"""


@click.command(cls=_inputs.lists("--validate"), epilog=EXAMPLE)
@_inputs.model_argument
@_inputs.bags_argument
@_inputs.validate_option
@_inputs.option(
    "--criterion",
    type=click.Choice(_inputs.CRITERIA),
    default="auto",
    help="What is made small: one-step errors, free-run errors or the unexplained drive force.",
)
@_inputs.model_options
@_outputs.output_option("FITTED.yaml", "Write the fitted model file.")
@_outputs.drawn_work_options
def command(
    model: Model,
    bags: tuple[Path, ...],
    *,
    validate: tuple[Path, ...],
    criterion: str,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Estimate the free parameters of MODEL from every BAG together.

    MODEL is a preset or a model file; a parameter is free where the file writes it as a mapping. What `idloop inspect`
    finds wrong with a bag is said in one line before the fit.
    """
    model = _inputs.with_options(model)
    train, validation = _inputs.read_fitted_and_unseen(bags, validate, model)

    from idloop.api.fit import fit

    grades = _inputs.log_grades((*bags, *validate), model, (*train, *validation))
    with progress(f"fitting {model.name}") as update:
        found = fit(model, train, validation, criterion=criterion, progress=update)
    found = replace(found, unusable=any(one.useless for one in grades[: len(bags)]))
    inspected = [one.to_dict() for one in grades]
    _outputs.deliver(found, as_json=as_json, output=output, plot=plot, inspections=inspected)
