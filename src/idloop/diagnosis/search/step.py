"""One step of a diagnosis: which of the models that were fitted says most of samples that no fit has seen."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

from idloop.diagnosis.evidence.predictive import Evidence, Scores
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.screening.proposals import Proposal
from idloop.physics.model import Model

# How a diagnosis may end: the words of its JSON.
MISSING, ADEQUATE, UNKNOWN, NOT_EXCITED = "missing", "adequate", "unknown_structure", "not_excited"
# Verdicts after which the reader may take what is left for noise.
SAY_NOISE = (ADEQUATE, NOT_EXCITED)
# A curve that explains so many times as much as an effect is what that stands in for: of three effects that are
# missing together the largest explains more.
FAR_MORE = 4.0


class Fitted(Protocol):
    """A model fitted in one view of the data."""

    @property
    def model(self) -> Model:
        """With the values found."""


class Structure(Protocol):
    """A curve that the errors follow."""

    @property
    def scores(self) -> Scores:
        """Of the model with the curve."""

    @property
    def evidence(self) -> Evidence:
        """Against the model without it."""

    def imitated_by(self, one: Weighed[Any]) -> bool:
        """Whether an effect of another shape may stand in for it."""

    @property
    def worth(self) -> float:
        """Part by which it makes errors on unseen samples smaller."""

    @property
    def of_the_drive(self) -> bool:
        """Whether it is about how the command becomes a force."""

    @property
    def text(self) -> str:
        """In words."""

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""


FitT = TypeVar("FitT", bound=Fitted)


@dataclass(frozen=True)
class Weighed(Generic[FitT]):
    """An effect, or two that show only together, with the model that has it fitted."""

    proposals: tuple[Proposal, ...]
    fit: FitT
    scores: Scores
    evidence: Evidence  # against the model without
    gain: float  # log-likelihood on the samples that were fitted
    held_out: float | None = None  # part by which it makes the errors on held-out records smaller, where there are any

    @property
    def merit(self) -> float:
        """What is sure of the evidence: the difference of the scores less its spread."""
        return self.evidence.difference + self.evidence.start - self.evidence.spread

    @property
    def richness(self) -> tuple[int, int]:
        """Of equals the least goes first: free parameters of the model, and effects that contain plainer ones."""
        return len(self.fit.model.free), sum(bool(proposal.effect.contains) for proposal in self.proposals)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects."""
        return tuple(proposal.name for proposal in self.proposals)

    @property
    def hollow(self) -> bool:
        """Whether an effect leaves nothing of a plainer one that it contains: only its further shape is used."""
        model = self.fit.model
        for proposal in self.proposals:
            own = {spec.name: spec for spec in proposal.effect.parameters}
            for shared in proposal.effect.contains.values():
                values = [(own[name], model.values[f"{proposal.name}.{name}"]) for name in shared.values()]
                if all(value == spec.neutral and spec.neutral in (spec.min, spec.max) for spec, value in values):
                    return True
        return False

    def contains(self, other: Weighed[FitT]) -> bool:
        """Whether its one effect is the other's and more."""
        return self._of_one_site(other) and other.proposals[0].effect.name in self.proposals[0].effect.contains

    def becomes(self, other: Weighed[FitT]) -> bool:
        """Whether its one effect ends as the other's at the edge of its values."""
        return self._of_one_site(other) and other.proposals[0].effect.name in self.proposals[0].effect.degenerates_to

    def _of_one_site(self, other: Weighed[FitT]) -> bool:
        (mine, *rest), (its, *further) = self.proposals, other.proposals
        return not rest and not further and mine.at == its.at


@dataclass(frozen=True)
class Step(ABC, Generic[FitT]):
    """What one step has weighed."""

    parent: FitT
    weighed: tuple[Weighed[FitT], ...]
    count: int  # choices that there were
    level: float  # probability of naming an effect where nothing is missing
    least: float  # part by which an effect must make the errors on unseen samples smaller to be named
    asked: tuple[Proposal, ...] = ()  # all that was looked for, fitted or not
    gate: Gate = field(default_factory=lambda: Gate((), {}, {}))  # what the data can show
    structures: Sequence[Structure] = ()  # curves that the errors follow, best first
    refused: Mapping[str, str] = field(default_factory=dict)  # effects not named whatever their evidence, and why

    response = CommandResponse.FOLLOWS  # of the motion to the command

    @property
    @abstractmethod
    def criterion(self) -> str:
        """What the models are measured by."""

    @abstractmethod
    def smaller(self, one: Weighed[FitT]) -> float:
        """Part by which an effect makes the errors on unseen samples smaller, at most 1."""

    @abstractmethod
    def only_together(self, pair: Weighed[FitT]) -> bool:
        """Whether two effects explain together what neither does alone."""

    @abstractmethod
    def too_small(self, one: Weighed[FitT]) -> str:
        """Why an effect that shows is not worth a name."""

    @abstractmethod
    def reported(self, fit: FitT) -> Model:
        """A fitted model with its standard errors."""

    @abstractmethod
    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """What is left when no effect is named, and findings about it."""

    def threshold(self, effects: int = 1) -> float:
        """Log-evidence from which on so many effects together are named."""
        return math.log(max(math.comb(self.count, effects), 1) / self.level)

    @cached_property
    def significant(self) -> list[Weighed[FitT]]:
        """What shows beyond doubt, worth naming or not, best first."""
        found = [one for one in self.weighed if self.shows(one.evidence, len(one.proposals))]
        return sorted(found, key=lambda one: -one.merit)

    def shows(self, evidence: Evidence, effects: int = 1) -> bool:
        """Whether there is evidence beyond doubt for so many effects together."""
        return evidence.log >= self.threshold(effects) and evidence.told

    @cached_property
    def eligible(self) -> list[Weighed[FitT]]:
        """What shows and is worth naming."""
        return [one for one in self.worthy(self.significant) if not self._stands_in(one)]

    def worthy(self, several: Sequence[Weighed[FitT]]) -> list[Weighed[FitT]]:
        """Of some choices those that show beyond doubt and are worth naming, best first."""
        found = [
            one for one in several
            if self.shows(one.evidence, len(one.proposals)) and not one.hollow
            and not self.refused.keys() & set(one.names) and self.worth(one)
        ]  # fmt: skip
        return sorted(found, key=lambda one: -one.merit)

    def worth(self, one: Weighed[FitT]) -> bool:
        """Whether it makes errors on samples not seen enough smaller, and two effects show only together."""
        return self.smaller(one) >= self.least and (len(one.proposals) == 1 or self.only_together(one))

    @cached_property
    def structure(self) -> Structure | None:
        """The curve that explains most of what no effect does; None where none shows or is worth telling."""
        return next((one for one in self.structures if self.shows(one.evidence) and one.worth >= self.least), None)

    def _stands_in(self, one: Weighed[FitT]) -> bool:
        """Whether an effect is named for want of a curve that explains far more: it fits a part of that."""
        return any(
            curve.evidence.difference >= FAR_MORE * one.evidence.difference
            and curve.evidence.told
            and curve.scores.against(one.scores).told
            and curve.imitated_by(one)
            for curve in self.structures
        )

    @cached_property
    def stand_ins(self) -> list[Weighed[FitT]]:
        """Effects that show and are worth naming, were there no curve that explains far more."""
        return [one for one in self.significant if self._stands_in(one) and self.worth(one)]

    @cached_property
    def tied(self) -> list[Weighed[FitT]]:
        """The best choice first, then those that the data cannot tell from it: of equals the plainest goes first."""
        if not self.eligible:
            return []
        best = self.eligible[0]
        equal = [one for one in self.eligible if one is best or self._equal(best, one)]
        first = min(equal, key=lambda one: (one.richness, -one.merit))
        # A plain effect earns its place before a richer one that contains it.
        first = next((one for one in self.eligible if first.contains(one) or self._nearly_becomes(first, one)), first)
        others = [
            one
            for one in self.eligible
            if one is not first and not one.contains(first) and not one.becomes(first) and not self._told(first, one)
        ]
        return [first, *others]

    def _nearly_becomes(self, rich: Weighed[FitT], plain: Weighed[FitT]) -> bool:
        """Whether half of what an effect explains is what another one does, as which it ends at its edge."""
        return rich.becomes(plain) and plain.evidence.difference >= 0.5 * rich.evidence.difference

    def _equal(self, best: Weighed[FitT], other: Weighed[FitT]) -> bool:
        """Whether the odds of two choices are less than those of a false alarm."""
        return best.scores.against(other.scores).log <= math.log(1.0 / self.level)

    def _told(self, best: Weighed[FitT], other: Weighed[FitT]) -> bool:
        return best.scores.against(other.scores).told and not self._equal(best, other)

    @property
    def names(self) -> tuple[str, ...]:
        """The first effect of the best choice, and single effects that the data cannot tell from it."""
        if not self.tied:
            return ()
        best = self.tied[0]
        if len(best.names) > 1:
            return best.names[:1]
        return (best.names[0], *(one.names[0] for one in self.tied[1:] if len(one.names) == 1))

    @property
    def passed_over(self) -> dict[str, str]:
        """Effects that show and are not worth a name, and why."""
        shown = {name for one in self.significant for name in one.names}
        found = {name: why for name, why in self.refused.items() if name in shown}
        for one in self.stand_ins:
            why = f"it stands in for something that explains far more: {self.structures[0].text}"
            found.setdefault(one.names[-1], why)
        for one in self.significant:
            if one in self.tied or one in self.stand_ins or len(one.proposals) > 1:
                continue
            if one.hollow:
                found.setdefault(one.names[-1], "nothing is left in it of the plainer effect that it contains")
            elif not self.worth(one):
                found.setdefault(one.names[-1], self.too_small(one))
        return {name: why for name, why in found.items() if name not in self.names}


class View(ABC, Generic[FitT]):
    """One view of the data, in which models are fitted and effects weighed."""

    @abstractmethod
    def weigh(self, parent: FitT) -> Step[FitT]:
        """Weigh every effect of the catalogue, and pairs of them where none shows alone."""

    @abstractmethod
    def again(self, fit: FitT) -> FitT:
        """The same model, searched as thoroughly as one that is to stay deserves."""

    @abstractmethod
    def without(self, fit: FitT, name: str) -> FitT | None:
        """The model without one of its effects, where that says as much of unseen samples; None where it does not."""
