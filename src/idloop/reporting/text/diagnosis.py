"""A diagnosis in words: what the data can show, the ranked effects, ties, the verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.equivalence.equivalent_effects import without_equivalents
from idloop.p_values import p_value_text
from idloop.reporting.residual_findings import residual_warnings
from idloop.reporting.text.blocks import Block, Table
from idloop.reporting.text.parameters import parameters_text, tie_text
from idloop.reporting.verdicts import MISSING, basis, explained_of, reserved_ending, scope_text

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis
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
        yield f"explains: part of {explained_of(found.criterion)}"
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
    for candidate in candidates:
        if candidate.model is None and not everything:
            continue
        mark = "*" if tied and candidate.name == tied[0] else "=" if candidate.name in tied else ""
        rows.append(
            (
                mark,
                candidate.name,
                p_value_text(candidate.p_value),
                f"{100.0 * candidate.explains:.1f}" if candidate.model is not None else "-",
                parameters_text(candidate.parameters) if candidate.model is not None else "-",
                candidate.testable,
                limits[candidate.name].short if candidate.name in limits else "-",
            )
        )
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
