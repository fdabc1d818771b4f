"""One step of a diagnosis: the evidence of all fitted models, and which effect is named."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import Evidence, Scores
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.screening.proposals import Proposal
from idloop.physics.effect import Effect
from idloop.physics.model import Model

Array = NDArray[np.float64]

# Verdicts of a diagnosis, as in its JSON.
MISSING, ADEQUATE, UNKNOWN, NOT_EXCITED = "missing", "adequate", "unknown_structure", "not_excited"
# Verdicts after which the remaining errors count as noise.
NOISE_VERDICTS = (ADEQUATE, NOT_EXCITED)
# An effect is confounded with a curve that explains this many times as much. Of three missing effects the largest
# explains a larger part.
CONFOUNDING_RATIO = 4.0
# Log-likelihood below which a gain is never significant.
LEAST_GAIN = 2.0


class Fitted(Protocol):
    """A model fitted in one view of the data."""

    @property
    def model(self) -> Model:
        """With the values found."""

    @property
    def covariance(self) -> Array:
        """Of its free parameters, shape (k, k) or more; not finite where they are not determined."""


class ResidualCurve(Protocol):
    """A curve that the errors follow."""

    @property
    def scores(self) -> Scores:
        """Of the model with the curve."""

    @property
    def evidence(self) -> Evidence:
        """Against the model without it."""

    def confounds(self, one: EvaluatedModel[Any]) -> bool:
        """Whether an effect is accepted only because it correlates with this curve."""

    @property
    def improvement(self) -> float:
        """Part by which it reduces the errors on unseen samples."""

    @property
    def of_the_drive(self) -> bool:
        """Whether it describes the drive, from command to force."""

    @property
    def text(self) -> str:
        """In words."""

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""


FitT = TypeVar("FitT", bound=Fitted)


@dataclass(frozen=True, eq=False)
class EvaluatedModel(Generic[FitT]):
    """A fitted model with one further effect, or with two that show only together, and its evidence."""

    proposals: tuple[Proposal, ...]
    fit: FitT
    scores: Scores
    evidence: Evidence  # against the model without
    gain: float  # log-likelihood on the samples that were fitted
    held_out: float | None = None  # part by which it reduces the errors on held-out records, if any
    as_fitted: bool = False  # whether the errors on these are like those on the fitted ones

    @property
    def lower_evidence(self) -> float:
        """The evidence less its standard deviation."""
        return self.evidence.difference + self.evidence.start - self.evidence.spread

    @property
    def complexity(self) -> tuple[int, int]:
        """Free parameters of the model, and effects that contain simpler ones: of ties the simplest goes first."""
        return len(self.fit.model.free), sum(bool(proposal.effect.contains) for proposal in self.proposals)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects."""
        return tuple(proposal.name for proposal in self.proposals)

    @property
    def contained_part_is_zero(self) -> bool:
        """Whether the simpler effect that one of its effects contains has become zero in it."""
        model = self.fit.model
        for proposal in self.proposals:
            own = {spec.name: spec for spec in proposal.effect.parameters}
            for shared in proposal.effect.contains.values():
                values = [(own[name], model.values[f"{proposal.name}.{name}"]) for name in shared.values()]
                if all(value == spec.neutral and spec.neutral in (spec.min, spec.max) for spec, value in values):
                    return True
        return False

    def contains(self, other: EvaluatedModel[FitT]) -> bool:
        """Whether its one effect contains that of the other."""
        differing = self._differing(other)
        return len(self.names) == 1 and differing is not None and differing[1].name in differing[0].contains

    def degenerates_to(self, other: EvaluatedModel[FitT]) -> bool:
        """Whether its one effect, or one of its two, is that of the other at the bound of its values."""
        differing = self._differing(other)
        return differing is not None and differing[1].name in differing[0].degenerates_to

    def _differing(self, other: EvaluatedModel[FitT]) -> tuple[Effect, Effect] | None:
        """The one effect of each that the other does not have, at the same place; None where there are more."""
        mine = [proposal for proposal in self.proposals if proposal.name not in other.names]
        its = [proposal for proposal in other.proposals if proposal.name not in self.names]
        if len(self.names) != len(other.names) or len(mine) != 1 or len(its) != 1 or mine[0].at != its[0].at:
            return None
        return mine[0].effect, its[0].effect


@dataclass(frozen=True)
class SearchStep(ABC, Generic[FitT]):
    """The models that one step has evaluated."""

    parent: FitT
    evaluated: tuple[EvaluatedModel[FitT], ...]
    count: int  # of candidates
    level: float  # probability of naming an effect where nothing is missing
    minimum_improvement: float  # least part by which a named effect reduces the errors on unseen samples
    proposed: tuple[Proposal, ...] = ()  # all candidates, fitted or not
    gate: Gate = field(default_factory=lambda: Gate((), {}, {}))  # what the data can show
    residual_curves: Sequence[ResidualCurve] = ()  # curves that the errors follow, best first
    # Effects not named whatever their evidence, and why: what the data do not determine, and the others.
    undetermined: Mapping[str, str] = field(default_factory=dict)
    rejected: Mapping[str, str] = field(default_factory=dict)
    # Settled so far, by the identity of the fit.
    settled_fits: dict[int, tuple[FitT, FitT]] = field(default_factory=dict, compare=False)

    response = CommandResponse.FOLLOWS  # of the motion to the command

    @property
    @abstractmethod
    def criterion(self) -> str:
        """What the models are measured by."""

    @abstractmethod
    def improvement(self, one: EvaluatedModel[FitT]) -> float:
        """Part by which an effect reduces the errors on unseen samples, at most 1."""

    @abstractmethod
    def jointly_needed(self, pair: EvaluatedModel[FitT]) -> bool:
        """Whether two effects together explain what neither explains alone."""

    @abstractmethod
    def insignificance(self, one: EvaluatedModel[FitT]) -> str:
        """Why a significant effect has no practical significance."""

    def settled(self, fit: FitT) -> FitT:
        """A fit to all samples, continued to its end where it was only ranked."""
        if id(fit) not in self.settled_fits:
            self.settled_fits[id(fit)] = fit, self._settled(fit)
        return self.settled_fits[id(fit)][1]

    def _settled(self, fit: FitT) -> FitT:
        return fit

    @abstractmethod
    def reported(self, fit: FitT) -> Model:
        """A fitted model with its standard errors."""

    @abstractmethod
    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """The verdict when no effect is named, and findings about it."""

    def threshold(self, effects: int = 1) -> float:
        """Log-evidence from which on this many effects together are named."""
        return math.log(max(math.comb(self.count, effects), 1) / self.level)

    @cached_property
    def significant(self) -> list[EvaluatedModel[FitT]]:
        """Models with conclusive evidence, best first."""
        found = [one for one in self.evaluated if self._conclusive(one)]
        return sorted(found, key=lambda one: -one.lower_evidence)

    def conclusive(self, evidence: Evidence, effects: int = 1) -> bool:
        """Whether the evidence for this many effects together is conclusive."""
        return evidence.log >= self.threshold(effects) and evidence.distinguishable

    def _conclusive(self, one: EvaluatedModel[FitT]) -> bool:
        """Whether the evidence for a model is conclusive, and its gain on the fitted samples more than chance.

        Folds are scored by fits with the slopes of that to all samples: where these fail, other samples seem to show
        what no fit does. By Wilks the gain of one parameter is beyond chance from about half the threshold on.
        """
        effects = len(one.proposals)
        return one.gain >= 0.5 * self.threshold(effects) and self.conclusive(one.evidence, effects)

    @cached_property
    def eligible(self) -> list[EvaluatedModel[FitT]]:
        """Significant models of practical significance that are not confounded, best first."""
        return [one for one in self.nameable(self.significant) if not self._is_confounded(one)]

    def nameable(self, several: Sequence[EvaluatedModel[FitT]]) -> list[EvaluatedModel[FitT]]:
        """Those of some models with conclusive evidence and practical significance, best first."""
        found = [
            one for one in several
            if self._conclusive(one) and not one.contained_part_is_zero
            and not (self.rejected.keys() | self.undetermined.keys()) & set(one.names)
            and self.practically_significant(one)
        ]  # fmt: skip
        return sorted(found, key=lambda one: -one.lower_evidence)

    def practically_significant(self, one: EvaluatedModel[FitT]) -> bool:
        """Whether it reduces errors on unseen samples enough, and needs both of two effects."""
        return self.improvement(one) >= self.minimum_improvement and (
            len(one.proposals) == 1 or self.jointly_needed(one)
        )

    @cached_property
    def residual_curve(self) -> ResidualCurve | None:
        """The significant curve that explains most; None without one."""
        return next(
            (
                one
                for one in self.residual_curves
                if self.conclusive(one.evidence) and one.improvement >= self.minimum_improvement
            ),
            None,
        )

    def _is_confounded(self, one: EvaluatedModel[FitT]) -> bool:
        """Whether an effect fits a part of a curve that explains far more."""
        return any(
            curve.evidence.difference >= CONFOUNDING_RATIO * one.evidence.difference
            and curve.evidence.distinguishable
            and curve.scores.against(one.scores).distinguishable
            and curve.confounds(one)
            for curve in self.residual_curves
        )

    @cached_property
    def confounded(self) -> list[EvaluatedModel[FitT]]:
        """Effects that would be named if there were no curve that explains far more."""
        return [one for one in self.significant if self._is_confounded(one) and self.practically_significant(one)]

    @cached_property
    def tied(self) -> list[EvaluatedModel[FitT]]:
        """The best model first, then those that tie with it; of ties the simplest goes first.

        None where that is one that the data do not determine: another one would only do as well.
        """
        if not self.eligible:
            return []
        best = self.eligible[0]
        equal = [one for one in self.eligible if one is best or not self._distinguished(best, one)]
        first = min(equal, key=lambda one: (one.complexity, -one.lower_evidence))
        if any(self._equal(best, one) and one.complexity < first.complexity for one in self._not_determined):
            return []
        # A simple effect is added before one that contains it.
        first = next(
            (one for one in self.eligible if first.contains(one) or self._nearly_degenerates_to(first, one)), first
        )
        others = [
            one
            for one in self.eligible
            if one is not first
            and not one.contains(first)
            and not one.degenerates_to(first)
            and not self._distinguished(first, one)
        ]
        return [first, *others]

    @property
    def _not_determined(self) -> list[EvaluatedModel[FitT]]:
        """Models with a significant effect of one parameter that the data do not determine.

        Of several parameters some may be free where the effect is plain: a spring that is soft and far off is a load.
        """
        plain = len(self.parent.model.free) + 1
        found = [one for one in self.significant if len(one.fit.model.free) == plain]
        return [one for one in found if self.undetermined.keys() & set(one.names)]

    def _nearly_degenerates_to(self, rich: EvaluatedModel[FitT], plain: EvaluatedModel[FitT]) -> bool:
        """Whether an effect that degenerates to another one explains nothing beyond chance that the other does not."""
        return rich.degenerates_to(plain) and not self._distinguished(rich, plain)

    def _equal(self, best: EvaluatedModel[FitT], other: EvaluatedModel[FitT]) -> bool:
        """Whether the odds between two models are below those of a false alarm."""
        return best.scores.against(other.scores).log <= math.log(1.0 / self.level)

    def _distinguished(self, best: EvaluatedModel[FitT], other: EvaluatedModel[FitT]) -> bool:
        return best.scores.against(other.scores).distinguishable and not self._equal(best, other)

    @property
    def names(self) -> tuple[str, ...]:
        """The first effect of the best model, and single effects that tie with it."""
        if not self.tied:
            return ()
        best = self.tied[0]
        if len(best.names) > 1:
            return best.names[:1]
        return (best.names[0], *(one.names[0] for one in self.tied[1:] if len(one.names) == 1))

    @property
    def passed_over(self) -> dict[str, str]:
        """Significant effects that are not named, and why."""
        shown = {name for one in self.significant for name in one.names}
        why = "it is confounded with something that explains far more: "
        found = {one.names[-1]: f"{why}{self.residual_curves[0].text}" for one in self.confounded}
        for name, why in {**self.rejected, **self.undetermined}.items():
            if name in shown:
                found.setdefault(name, why)
        members = {other.names for other in (*self.tied, *self.confounded)}
        for one in self.significant:
            if one.names in members or len(one.proposals) > 1:
                continue
            if one.contained_part_is_zero:
                found.setdefault(one.names[-1], "the simpler effect that it contains is zero in it")
            elif not self.practically_significant(one):
                found.setdefault(one.names[-1], self.insignificance(one))
            elif not self.tied:
                found.setdefault(one.names[-1], "the data cannot tell it from a simpler one that they do not determine")
        return {name: why for name, why in found.items() if name not in self.names}


class View(ABC, Generic[FitT]):
    """A view of the data in which models are fitted and effects evaluated."""

    @abstractmethod
    def within(self, begin: float, end: float) -> View[FitT]:
        """The view with its progress as a part of the work, from one share of the whole to another."""

    @abstractmethod
    def evaluate(self, parent: FitT) -> SearchStep[FitT]:
        """Evaluate every effect of the catalogue, and pairs where none is significant alone."""

    def with_timing(self, step: SearchStep[FitT]) -> tuple[View[FitT], FitT] | None:
        """The view with corrected stamps of the command, and the parent of a step in it; None where they need none."""
        return None

    def leaves_model_error(self, fit: FitT) -> bool:
        """Whether a model leaves much that no noise accounts for, so that effects of ties are exchanged."""
        return False

    def exchanged(self, fit: FitT, name: str, other: str) -> FitT | None:
        """A model with another effect in place of one that did the same alone; None where it explains less now."""
        return None

    @abstractmethod
    def reported(self, fit: FitT) -> Model:
        """A model fitted to all samples, with its standard errors."""

    @abstractmethod
    def refit_thoroughly(self, fit: FitT) -> FitT:
        """The same model after a thorough search, for a model that stays."""

    @abstractmethod
    def without(self, fit: FitT, name: str) -> FitT | None:
        """The model without one of its effects, where its evidence is no less; else None."""

    @abstractmethod
    def refitted(self, model: Model, fit: FitT) -> Model | None:
        """Another model, fitted beside a fit from its values on, with standard errors; None where it cannot be."""
