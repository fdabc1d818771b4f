"""`idloop diagnose`: which physical effects a model lacks, ranked by what they say of unseen samples."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress

if TYPE_CHECKING:
    from idloop.physics import Model

EXAMPLE = """\b
Examples:
  idloop diagnose dc_motor bags/train
  idloop diagnose fitted.yaml bags/slow bags/fast --level 0.05
  idloop diagnose emps bags/train --effects coulomb_friction stribeck_friction --json
"""


@click.command(cls=_inputs.lists("--validate", "--effects"), epilog=EXAMPLE)
@_inputs.model_argument
@_inputs.bags_argument
@_inputs.validate_option
@_inputs.diagnosis_options
@_inputs.model_options
@click.option("--all", "everything", is_flag=True, help="List every effect of the catalogue, also what shows nothing.")
@_outputs.work_options
def command(
    model: Model,
    bags: tuple[Path, ...],
    validate: tuple[Path, ...],
    *,
    everything: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Name the physical effects that MODEL lacks to explain every BAG.

    First what this data can show at all; then the effects, ranked by what models with them say of samples that their
    fits have not seen, with the share of the error that each explains. Effects that the data cannot tell apart are one
    set. What does not reduce the errors on bags of --validate as well is listed, not named.
    """
    model = _inputs.with_options(model)
    records, unseen = _inputs.read_fitted_and_unseen(bags, validate, model)
    _inputs.log_grades(bags, model, records)

    from idloop.api.diagnosis import diagnose

    with progress(f"diagnosing {model.name}") as update:
        found = diagnose(model, records, validate=unseen, **_inputs.search_options(options), progress=update)
    _outputs.print_either(partial(found.blocks, everything=everything), found.to_dict() if as_json else None)
