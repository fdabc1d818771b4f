"""`idloop diagnose`: which physical effects a model lacks, ranked by what they say of unseen samples."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli._common import BAG, MODEL, apply_options, json_option, model_options, print_json, read_records
from idloop.cli._diagnosis import DiagnosisCommand, diagnosis_options, print_candidates, tie_text
from idloop.cli._progress import part, progress, quiet_option
from idloop.reporting.verdicts import MISSING, basis, ending, explained_of

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis
    from idloop.diagnosis.equivalence.equivalent_effects import Twins
    from idloop.diagnosis.worsened import Worsened
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.remains import Remainder

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
    level: float,
    minimum_improvement: float,
    only: tuple[str, ...],
    criterion: str,
    seed: int,
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    everything: bool,
    as_json: bool,
) -> None:
    """Name the physical effects that MODEL lacks to explain every BAG.

    First what this data can show at all; then the effects, ranked by what models with them say of samples that their
    fits have not seen, with the share of the error that each explains. Effects that the data cannot tell apart are one
    set.
    """
    model = apply_options(model, settings, effects)
    records = read_records(bags, model)

    from idloop.diagnosis import diagnose
    from idloop.reporting.remains import compared

    with progress(f"diagnosing {model.name}") as update:
        found = diagnose(
            model,
            records,
            level=level,
            criterion=criterion,
            minimum_improvement=0.01 * minimum_improvement,
            effects=only or None,
            seed=seed,
            progress=part(update, 0.0, 0.9),
        )
        update(0.9, "what is left")
        left = compared(found.model, records)
        worse = _worsened(found, records)
    if as_json:
        print_json(
            {
                **found.to_dict(),
                "residual": [one.to_dict() for one in left],
                "worsened": [one.to_dict() for one in worse],
            }
        )
        return
    print_diagnosis(found, left, worse, everything=everything)


def _worsened(found: Diagnosis, records: Sequence[Record]) -> list[Worsened]:
    """The missing effect, where the free run on the fitted data is worse with it."""
    from idloop.diagnosis.model_errors import model_errors
    from idloop.diagnosis.worsened import worsened

    best = found.best
    if best is None or best.model is None:
        return []
    errors = [model_errors(model, records) for model in (found.model, best.model)]
    return worsened(["", " with ".join(found.pair or (best.name,))], errors, unseen=False)


def print_diagnosis(
    found: Diagnosis, left: Sequence[Remainder] = (), worse: Sequence[Worsened] = (), *, everything: bool = False
) -> None:
    """Print gate, ranked table, tie, verdict with its physics and what speaks against it, what the data cannot show."""
    from idloop.reporting.remains import remainder_lines
    from idloop.reporting.tried import only_words

    for line in found.gate.findings:
        click.echo(line)
    click.echo()
    print_candidates(found.candidates, found.set, found.gate.limits, everything=everything)
    best = found.best
    lacking = [] if best is None else list(found.pair or (best.name,))
    if any(one.model is not None for one in found.candidates):
        click.echo(f"explains: part of {explained_of(found.criterion)}")
    if lacking:
        click.echo(f"testable, would show with: {basis(lacking).removesuffix(', ')}; look again with it")
    click.echo()
    if best is not None and found.pair is not None:
        click.echo(f"{MISSING}, only together: {' and '.join(found.pair)}; each hides the other")
        for one in found.candidates[:2]:
            click.echo(f"{one.name}: {one.text}")
        for rung in found.rungs:
            ties = ", ".join(rung.set[1:])
            _print_tie(f"this data cannot tell {rung.set[0]} from {ties}", rung.set, found.twins)
    elif best is not None:
        rivals = len(found.set) - 1
        tie = f", or one of {rivals} that this data cannot tell from it" if rivals else ""
        click.echo(f"{MISSING}: {best.name}{tie}. {best.text}")
        if best.replaces:
            plain = "its plain form" if best.replaces == best.name else best.replaces
            click.echo(f"it takes the place of {plain}, which it contains")
        _print_tie(tie_text(found.set), found.set, found.twins)
    else:
        click.echo(ending(found.verdict, only_words(found), found.response))
        if found.unknown is not None:
            click.echo(found.unknown.text)
        for line in remainder_lines(found.verdict, left):
            click.echo(line)
    for step in worse:
        click.echo(f"beware: {step.text}")
    for name, why in found.passed_over.items():
        click.echo(f"significant, yet passed over: {name}: {why}")
    hidden = [name for name in found.untestable if name not in found.set]
    if hidden:
        click.echo()
        click.echo(f"{basis(lacking)}this data cannot show:")
        for name in hidden:
            click.echo(f"  {name}: {found.gate.why.get(name, 'not excited')}")


def _print_tie(text: str, tied: Sequence[str], twins: Sequence[Twins]) -> None:
    """Print a tie, and what would resolve it: an experiment, or a check by hand where no motion can."""
    from idloop.diagnosis.equivalence.equivalent_effects import one_of_each

    if len(tied) > 1:
        further = len(one_of_each(tied, twins)) > 1
        click.echo(f"{text}: idloop suggest chooses the experiment that can" if further else text)
    for group in twins:
        if group.names[0] in tied:
            click.echo("\n".join(group.lines))
