"""`idloop diagnose`: which physical effects a model lacks, ranked by what they say of unseen samples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._common import (
    BAG,
    MODEL,
    apply_options,
    json_option,
    log_grades,
    model_options,
    print_blocks,
    print_json,
    read_records,
)
from idloop.cli._diagnosis import DiagnosisCommand, diagnosis_options
from idloop.cli._progress import progress, quiet_option

if TYPE_CHECKING:
    from idloop.physics import Model

EXAMPLE = """\b
Examples:
  idloop diagnose dc_motor bags/train
  idloop diagnose fitted.yaml bags/slow bags/fast --level 0.05
  idloop diagnose emps bags/train --effects coulomb_friction stribeck_friction --json
"""


@click.command(cls=DiagnosisCommand, epilog=EXAMPLE)
@click.argument("model", type=MODEL)
@click.argument("bags", type=BAG, nargs=-1, required=True, metavar="BAG...")
@diagnosis_options
@model_options
@click.option("--all", "everything", is_flag=True, help="List every effect of the catalogue, also what shows nothing.")
@quiet_option
@json_option
def command(
    model: Model,
    bags: tuple[Path, ...],
    *,
    minimum_improvement: float,
    only: tuple[str, ...],
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    everything: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Name the physical effects that MODEL lacks to explain every BAG.

    First what this data can show at all; then the effects, ranked by what models with them say of samples that their
    fits have not seen, with the share of the error that each explains. Effects that the data cannot tell apart are one
    set.
    """
    model = apply_options(model, settings, effects)
    records = read_records(bags, model)
    log_grades(bags, model, records)

    from idloop.api.diagnosis import diagnose

    with progress(f"diagnosing {model.name}") as update:
        options |= {"minimum_improvement": 0.01 * minimum_improvement, "effects": only or None, "progress": update}
        found = diagnose(model, records, **options)
    if as_json:
        print_json(found.to_dict())
    else:
        print_blocks(found.blocks(everything=everything))
