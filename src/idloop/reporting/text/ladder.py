"""A ladder in words: one line a step, the verdict, what would be next, the parameters of the last model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from idloop.diagnosis.equivalence.equivalent_effects import equivalent_effects_of_ladder
from idloop.estimation.statistics.interval_text import interval_text
from idloop.p_values import p_value_text
from idloop.reporting.detectability import significant_not_added, undetectable
from idloop.reporting.estimates import held_parameters, not_determined, parameter_estimates, read_off_parameters
from idloop.reporting.residual_findings import residual_warnings
from idloop.reporting.scores import disagreements, judging, step_scores
from idloop.reporting.terms import DATA_USE
from idloop.reporting.text.blocks import Block, Table, number
from idloop.reporting.text.next_experiment import experiment_blocks
from idloop.reporting.text.parameters import parameters_text
from idloop.reporting.verdicts import CRITERIA, basis, conclusion, scope_text
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.reporting.residual_findings import ResidualFinding


def ladder_blocks(ladder: Ladder, left: Sequence[ResidualFinding] = ()) -> Iterator[Block]:
    """Yield the table of steps, the verdict with its physics and caveats, and what would be next.

    `left`: residual tests of the last model on the fitted data.
    """
    yield from ladder.findings
    kind = judging(ladder)
    names = list(ladder.steps[0].model.output_names)
    scores = [step_scores(step, kind) for step in ladder.steps]
    forces = any(DRIVE_FORCE in found for found in scores)
    rows = []
    for step, found in zip(ladder.steps, scores, strict=True):
        added = step.added
        shown = (*names, *([DRIVE_FORCE] if forces else []))
        rows.append(
            (
                "start" if added is None else f"+ {added.name}",
                "-" if added is None else "own choice" if step.chosen_by == "user" else p_value_text(step.p_value),
                *(found[name].cell if name in found else "-" for name in shown),
                "" if added is None else parameters_text(added.parameters),
            )
        )
    measured = [*(f"FIT % {name}" for name in names), *(["force error %"] if forces else [])]
    yield Table.of(("step", "p", *measured, "parameters at that step (95 %)"), rows)
    yield f"(fitted to {CRITERIA[ladder.criterion]}; errors of the {DATA_USE[kind]} data)"
    for step in ladder.steps:
        others = ladder.rivals(step)
        if step.added is not None:
            yield f"{step.added.name}: {step.added.text}"
            if replaced := ladder.replaced(step):
                yield f"  {replaced}"
        if others:
            yield f"  this data cannot tell it from {', '.join(others)}"
    for group in equivalent_effects_of_ladder(ladder):
        yield from group.lines
    yield f"verdict: {conclusion(ladder, left, scope_text(ladder))}"
    for one in ladder.worsened:
        yield f"warning: {one.text}"
    yield from disagreements(ladder)
    if ladder.unknown is not None:
        yield ladder.unknown.text
    yield from residual_warnings(ladder.verdict, left)
    over = ", ".join(f"{one.name} (p {p_value_text(one.p_value)})" for one in significant_not_added(ladder))
    if over and ladder.verdict == "missing":
        yield f"significant as well: {over}"
    for name, why in ladder.passed_over.items():
        yield f"significant on the fitted data, yet not added: {name}: {why}"
    hidden = undetectable(ladder)
    if hidden:
        lacking = ["what is still missing"] if ladder.verdict == "missing" else []
        yield f"{basis(lacking)}this data cannot show: {', '.join(hidden)}"
    suggested = ladder.suggested_experiment
    if suggested is not None:
        yield from experiment_blocks(suggested)


def parameter_blocks(ladder: Ladder) -> Iterator[Block]:
    """Yield the last model's parameters: those of a step are biased by what was still missing then."""
    rows = [
        (
            name,
            number(one["value"], 6),
            "not determined" if None in one["interval"] else interval_text(*one["interval"]),
            f"{one['unit']}{'  at its bound' if one['at_bound'] else ''}",
        )
        for name, one in parameter_estimates(ladder.model).items()
    ]
    if rows:
        yield ""
        yield "parameters of the last model, all refitted:"
        yield Table.of(("parameter", "value", "95 % interval", "unit"), rows)
    yield from not_determined(ladder.model)
    for name, one in read_off_parameters(ladder).items():
        yield f"read off the readings: {name} {number(one.value, 6)} {one.unit}"
    held = [f"{name} {number(one.value)} {one.unit}".rstrip(" -") for name, one in held_parameters(ladder).items()]
    if held:
        yield f"held, not estimated: {', '.join(held)}"
