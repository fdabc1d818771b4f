"""A diagnosis and a ladder in words: effects and ties, steps and parameters, the verdict, what would be next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.equivalence.equivalent_effects import equivalent_effects_of_ladder, without_equivalents
from idloop.estimation.statistics.interval_text import interval_text
from idloop.p_values import p_value_text
from idloop.reporting.estimates import (
    held_parameters,
    not_determined,
    parameter_estimates,
    parameters_text,
    read_off_parameters,
    tie_text,
)
from idloop.reporting.next_experiment import experiment_blocks
from idloop.reporting.residual_findings import residual_warnings
from idloop.reporting.scores import disagreements, judging, step_scores
from idloop.reporting.terms import DATA_USE
from idloop.reporting.text.blocks import Block, Table, number
from idloop.reporting.verdicts import (
    MISSING,
    basis,
    conclusion,
    criterion_words,
    explained_of,
    reserved_ending,
    scope_text,
    significant_not_added,
    undetectable,
)
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis, Ladder
    from idloop.diagnosis.equivalence.equivalent_effects import EquivalentEffects
    from idloop.diagnosis.evidence.detection_limit import DetectionLimit
    from idloop.diagnosis.worsened import Worsened
    from idloop.reporting.residual_findings import ResidualFinding


def diagnosis_blocks(
    found: Diagnosis,
    left: Sequence[ResidualFinding] = (),
    worse: Sequence[Worsened] = (),
    errors: Mapping[str, Any] = MappingProxyType({}),
    *,
    everything: bool = False,
) -> Iterator[Block]:
    """Yield findings, ranked table, tie, verdict with its physics and caveats, and what the data cannot show.

    `left`: residual tests of the model on the fitted data.
    `worse`: the missing effect, where the free run is worse with it.
    `errors`: of the model on the fitted data, as `idloop.diagnosis.model_errors` has them.
    `everything`: list every effect of the catalogue.
    """
    yield from found.gate.findings
    yield ""
    yield from _candidates(found.candidates, found.set, found.gate.limits, everything=everything)
    best = found.best
    lacking = [] if best is None else list(found.pair or (best.name,))
    if any(one.model is not None for one in found.candidates):
        yield f"explains: part of {explained_of(found.criterion, len(found.model.bodies))}"
    if lacking:
        yield f"testable, would show with: {basis(lacking).removesuffix(', ')}; look again with it"
    yield ""
    if best is not None and found.pair is not None:
        yield f"{MISSING}, only together: {' and '.join(found.pair)}; each masks the other"
        for one in found.candidates[:2]:
            yield f"{one.name}: {one.text}"
        for rung in found.rungs:
            ties = ", ".join(rung.set[1:])
            yield from _tie(f"this data cannot tell {rung.set[0]} from {ties}", rung.set, found.equivalent_effects)
    elif best is not None:
        rivals = len(found.set) - 1
        tie = f", or one of {rivals} that this data cannot tell from it" if rivals else ""
        yield f"{MISSING}: {best.name}{tie}. {best.text}"
        if best.replaces:
            plain = "its plain form" if best.replaces == best.name else best.replaces
            yield f"it takes the place of {plain}, which it contains"
        yield from _tie(tie_text(found.set), found.set, found.equivalent_effects)
    else:
        yield reserved_ending(found.verdict, left, errors, scope_text(found), found.response)
        if found.unknown is not None:
            yield found.unknown.text
        yield from residual_warnings(found.verdict, left)
    for step in worse:
        yield f"warning: {step.text}"
    for name, why in found.passed_over.items():
        yield f"significant, yet passed over: {name}: {why}"
    hidden = [name for name in found.untestable if name not in found.set]
    if hidden:
        yield ""
        yield f"{basis(lacking)}this data cannot show:"
        for name in hidden:
            yield f"  {name}: {found.gate.why.get(name, 'not excited')}"


def _candidates(
    candidates: Sequence[Candidate], tied: Sequence[str], limits: Mapping[str, DetectionLimit], *, everything: bool
) -> Iterator[Block]:
    rows = []
    for one in candidates:
        fitted = one.model is not None
        if fitted or everything:
            mark = "*" if tied and one.name == tied[0] else "=" if one.name in tied else ""
            shown = (f"{100.0 * one.explains:.1f}", parameters_text(one.parameters)) if fitted else ("-", "-")
            limit = limits[one.name].short if one.name in limits else "-"
            rows.append((mark, one.name, p_value_text(one.p_value), *shown, one.testable, limit))
    if rows:
        yield Table.of(("", "effect", "p", "explains %", "parameters (95 %)", "testable", "would show with"), rows)
    screened = sum(candidate.model is None for candidate in candidates)
    if screened and not everything:
        yield f"{screened} more effects were screened and show nothing (--all lists them)"


def _tie(text: str, tied: Sequence[str], twins: Sequence[EquivalentEffects]) -> Iterator[Block]:
    """A tie and what would resolve it: an experiment, or a check by hand where no motion can."""
    if len(tied) > 1:
        further = len(without_equivalents(tied, twins)) > 1
        yield f"{text}: idloop suggest chooses the experiment that can" if further else text
    for group in twins:
        if group.names[0] in tied:
            yield from group.lines


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
        added, shown = step.added, (*names, *([DRIVE_FORCE] if forces else []))
        evidence = "-" if added is None else "own choice" if step.chosen_by == "user" else p_value_text(step.p_value)
        cells = (found[name].cell if name in found else "-" for name in shown)
        what, parameters = ("start", "") if added is None else (f"+ {added.name}", parameters_text(added.parameters))
        rows.append((what, evidence, *cells, parameters))
    measured = [*(f"FIT % {name}" for name in names), *(["force error %"] if forces else [])]
    yield Table.of(("step", "p", *measured, "parameters at that step (95 %)"), rows)
    judged_by = criterion_words(ladder.criterion, len(ladder.model.bodies))
    yield f"(fitted to {judged_by}; errors of the {DATA_USE[kind]} data)"
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
    rows = []
    for name, one in parameter_estimates(ladder.model).items():
        interval = "not determined" if None in one["interval"] else interval_text(*one["interval"])
        unit = f"{one['unit']}{'  at its bound' if one['at_bound'] else ''}"
        rows.append((name, number(one["value"], 6), interval, unit))
    if rows:
        yield ""
        yield "parameters of the last model, all refitted:"
        yield Table.of(("parameter", "value", "95 % interval", "unit"), rows)
    yield from not_determined(ladder.model)
    for name, read in read_off_parameters(ladder).items():
        yield f"read off the readings: {name} {number(read.value, 6)} {read.unit}"
    held = [f"{name} {number(one.value)} {one.unit}".rstrip(" -") for name, one in held_parameters(ladder).items()]
    if held:
        yield f"held, not estimated: {', '.join(held)}"
