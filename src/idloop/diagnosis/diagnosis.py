"""The result of a diagnosis: what a model lacks, by one step of the search."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from idloop.diagnosis.candidate import Candidate, Rung, effect_parameters
from idloop.diagnosis.equivalence.equivalent_effects import EquivalentEffects, find_equivalent_effects
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.search.step import MISSING, EvaluatedModel, FitT, SearchStep
from idloop.estimation.direction import opposite_direction_warning
from idloop.estimation.statistics.undetermined import Undetermined, common_factor
from idloop.physics.layout import lay_out
from idloop.physics.model import Model


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks on a set of records.

    Attributes
    ----------
    model : Model
        The model, its free parameters refitted.
    candidates : tuple of Candidate
        All effects that were evaluated, best first.
    set : tuple of str
        Effects that tie with the best one, itself first; empty when none is significant.
        Of a pair: those that would do in the place of its first, beside its second.
    verdict : {"missing", "adequate", "unknown_structure", "not_excited"}
    gate : Gate
        What this data can show.
    unknown : UnknownStructure or None
        What remains when no effect of the catalogue explains it.
    criterion : str
        What the models were measured by.
    level : float
        Family-wise error rate.
    pair : tuple of str, or None
        The best effect and the one without which it does not show: no single effect is significant,
        the two together are, and the models of both candidates have both.
    rival_pairs : tuple of tuple of str
        Pairs that tie with it.
    alone : Candidate or None
        The first effect of the pair with the model that has no other: where a ladder comes by.
    passed_over : mapping of str to str
        Effects that are significant on the fitted data and not missing physics, and why.
    response : CommandResponse
        How the motion follows the command.
    threshold : float
        Log-evidence from which on an effect is named.
    """

    model: Model
    candidates: tuple[Candidate, ...]
    set: tuple[str, ...]
    verdict: str
    gate: Gate
    unknown: UnknownStructure | None
    criterion: str
    level: float
    pair: tuple[str, str] | None = None
    rival_pairs: tuple[tuple[str, str], ...] = ()
    alone: Candidate | None = None
    passed_over: Mapping[str, str] = field(default_factory=dict)
    response: CommandResponse = CommandResponse.FOLLOWS
    threshold: float = math.inf

    @property
    def best(self) -> Candidate | None:
        """The missing effect; None when none is significant."""
        return self.candidates[0] if self.set else None

    @property
    def reached(self) -> Model | None:
        """The model with the missing effect, or with both of a pair; None when none is significant."""
        return None if self.best is None else self.best.model

    @property
    def equivalent_effects(self) -> tuple[EquivalentEffects, ...]:
        """Effects that have the same equation as the missing one."""
        if self.pair is not None:
            return tuple(group for rung in self.rungs for group in find_equivalent_effects(self.model, rung.set))
        return find_equivalent_effects(self.model, self.set, None if self.best is None else self.best.replaces)

    @property
    def rungs(self) -> tuple[Rung, ...]:
        """What a ladder adds: nothing, the best effect, or both effects of a pair."""
        if self.best is None:
            return ()
        if self.pair is None or self.alone is None:
            return (Rung(self.best, self.set),)
        tied = tied_members(self.pair[1], self.pair[0], self.rival_pairs)
        return Rung(self.alone, self.set), Rung(self.candidates[1], tied)

    @property
    def untestable(self) -> tuple[str, ...]:
        """Effects that this data cannot show, without those that it has shown: found, passed over, or equivalent."""
        alike = (part for group in self.equivalent_effects for part in group.parts)
        shown = {*self.set, *(self.pair or ()), *self.passed_over, *alike}
        return tuple(name for name in self.gate.untestable if name not in shown)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, schema ``idloop/diagnose/1``."""
        return {
            "schema": "idloop/diagnose/1",
            "model": self.model.name,
            "criterion": self.criterion,
            "level": self.level,
            "verdict": self.verdict,
            "best": None if self.best is None else self.best.name,
            "set": list(self.set),
            "pair": None if self.pair is None else list(self.pair),
            "rival_pairs": [list(names) for names in self.rival_pairs],
            "candidates": [c.to_dict() for c in self.candidates],
            "untestable": list(self.untestable),
            "gate": self.gate.to_dict(),
            "unknown": None if self.unknown is None else self.unknown.to_dict(),
            "passed_over": dict(self.passed_over),
            "one_equation": [group.to_dict() for group in self.equivalent_effects],
            "response": self.response.value,
            "threshold": self.threshold if math.isfinite(self.threshold) else None,
        }


def tied_members(own: str, other: str, rivals: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Effects that rival pairs have instead of one effect beside another one, that one itself first."""
    found = [name for names in rivals if other in names for name in names if name != other]
    return tuple(dict.fromkeys((own, *found)))


def diagnosis_of(step: SearchStep[FitT]) -> Diagnosis:
    """What one step has found, as a diagnosis."""
    ending = step_ending(step)
    findings = ending.pop("findings")
    pair = alone = None
    if step.tied and len(step.tied[0].proposals) > 1:
        pair = (step.tied[0].proposals[0].name, step.tied[0].proposals[1].name)
        alone = first_of_pair(step, step.tied[0])
    found = Diagnosis(
        model=step.reported(step.parent),
        set=step.names,
        gate=replace(step.gate, findings=findings),
        criterion=step.criterion,
        level=step.level,
        pair=pair,
        rival_pairs=rival_pairs(step),
        alone=alone,
        threshold=step.threshold(),
        **ending,
    )
    # An effect that is equivalent to the missing one together with another is not passed over.
    parts = {part for group in found.equivalent_effects for part in group.parts}
    return replace(found, passed_over={name: why for name, why in found.passed_over.items() if name not in parts})


def step_ending(step: SearchStep[FitT]) -> dict[str, Any]:
    """What a diagnosis and a ladder report of their last step."""
    verdict, findings = (MISSING, ()) if step.tied else step.verdict()
    fit = step.settled(step.tied[0].fit) if step.tied else step.parent
    factor = common_factor(fit.model, fit.covariance)
    if factor is not None:
        findings = (*findings, factor.text)
    unknown = None
    if not step.tied and step.residual_curve is not None:
        unknown = step.residual_curve.unknown(max(step.residual_curve.evidence.p_value(step.count), 1e-300))
    return {
        "verdict": verdict,
        "findings": (*step.gate.findings, *findings),
        "candidates": _candidates_of(step),
        "unknown": unknown,
        "passed_over": step.passed_over,
        "response": CommandResponse.FOLLOWS if step.tied else step.response,
    }


def rival_pairs(step: SearchStep[FitT]) -> tuple[tuple[str, str], ...]:
    """Pairs that tie with the best choice."""
    return tuple((a, b) for one in step.tied[1:] if len(one.names) == 2 for a, b in [one.names])


def first_of_pair(step: SearchStep[FitT], pair: EvaluatedModel[FitT]) -> Candidate:
    """The first effect of a pair, with the evidence for both and the model that has no other, where that was fitted."""
    first = next((one for one in step.evaluated if one.names == pair.names[:1]), pair)
    return candidate_of(step, pair, 0, step.reported(first.fit))


def candidate_of(step: SearchStep[FitT], one: EvaluatedModel[FitT], which: int, model: Model) -> Candidate:
    """One effect of a choice that was evaluated, with its evidence and a fitted model that has it."""
    proposal, evidence = one.proposals[which], one.evidence
    together = [other.name for other in one.proposals if other is not proposal]
    why = f"it shows together with {together[0]} only" if together else step.gate.why.get(proposal.name, "")
    several = step.threshold(len(one.proposals)) - step.threshold()
    return Candidate(
        effect=proposal.effect.name,
        at=proposal.at,
        testable="yes" if one in step.tied else step.gate.testable.get(proposal.name, "yes"),
        why=why,
        text=proposal.effect.text,
        gain=evidence.difference,
        p_value=max(evidence.p_value(math.comb(step.count, len(one.proposals))), 1e-300),
        explains=float(np.clip(1.0 - np.exp(-2.0 * evidence.difference / max(evidence.samples, 1)), 0.0, 1.0)),
        parameters=effect_parameters(model, proposal.name),
        model=model,
        replaces=proposal.replaces,
        number=proposal.number,
        course=evidence.course.less(several),
    )


def _candidates_of(step: SearchStep[FitT]) -> tuple[Candidate, ...]:
    """All effects that were evaluated, the best choice first, each once; then those that were only screened."""
    found: dict[str, Candidate] = {}
    others = sorted((one for one in step.evaluated if one not in step.tied), key=lambda one: -one.lower_evidence)
    for one in [*step.tied, *others]:
        model = step.reported(one.fit) if one in step.tied else one.fit.model
        for which, proposal in enumerate(one.proposals):
            found.setdefault(proposal.name, candidate_of(step, one, which, model))
    for proposal in step.proposed:
        name, effect = proposal.name, proposal.effect
        testable, why = step.gate.testable.get(name, "no"), step.gate.why.get(name, "")
        screened = Candidate(
            effect.name, proposal.at, testable, why, effect.text, replaces=proposal.replaces, number=proposal.number
        )
        found.setdefault(name, screened)
    return tuple(found.values())


def findings_of_model(
    start: Model,
    reached: Model,
    added: Collection[str],
    response: CommandResponse,
    undetermined: Sequence[Undetermined],
) -> list[str]:
    """Findings about the fitted model: direction of the command, undetermined scales, bodies that an effect splits."""
    direction = "" if response.uninformative else opposite_direction_warning(start, reached)
    return [
        *([direction] if direction else []),
        *(one.text for one in undetermined if one.text),
        *split_body_findings(reached, added),
    ]


def split_body_findings(model: Model, added: Collection[str]) -> list[str]:
    """How to write a split body as two bodies in the model file, one line for each new effect that splits one."""
    layout, units = lay_out(model), model.units
    found = []
    for coupling, active in model.inner_couplings.items():
        joint = layout.joint_of.get(coupling)
        if active.name not in added or joint is None:
            continue
        near, far = layout.axis.inertia[joint : joint + 2]
        found.append(
            f"{active.name} splits {active.at} into two bodies (inertia {near:.3g} and {far:.3g} {units.inertia}, "
            f"stiffness {layout.axis.stiffness[joint]:.3g} {units.fill('{force}/{position}')}); sensors and effects of "
            f"{active.at} are those of the first: write both as bodies with a coupling in the model file where the "
            "second has a sensor or friction of its own"
        )
    return found
