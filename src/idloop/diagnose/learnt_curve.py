"""Curves learnt from the errors of a prediction, weighed as effects are: by samples that no fit has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from idloop.diagnose.candidate import effect_parameters
from idloop.diagnose.innovation_scores import InnovationScores
from idloop.diagnose.learnt import Learnt
from idloop.diagnose.predictive import Evidence, Scores
from idloop.diagnose.screen import Screen
from idloop.diagnose.step import Weighed
from idloop.diagnose.unknown import DRIVE_CURVES, UnknownStructure, unknown_structure
from idloop.estimate.likelihood.refit import Refit

# Part of its trace's power beyond a force's curve from which on an effect is none of the curve's kind.
_OF_ITS_KIND = 0.5


@dataclass(frozen=True)
class LearntCurve:
    """A curve that the errors follow.

    Attributes
    ----------
    screen : Screen
        Errors of the model without it.
    learnt : Learnt
    innovations : InnovationScores
        The same errors, in folds.
    scores : Scores
    evidence : Evidence
        Against the model without it.
    rivals : tuple of str
        Other curves that the data cannot tell from it, in words.
    """

    screen: Screen
    learnt: Learnt
    innovations: InnovationScores
    scores: Scores
    evidence: Evidence
    rivals: tuple[str, ...] = ()

    @classmethod
    def weighed(cls, screen: Screen, found: Sequence[Learnt], innovations: InnovationScores) -> list[LearntCurve]:
        """Curves that the errors follow with their evidence, best first.

        Parameters
        ----------
        screen : Screen
        found : sequence of Learnt
        innovations : InnovationScores
            Of the model that was screened.
        """
        base, weighed = innovations.beside(np.zeros((len(innovations.errors), 0))), []
        for learnt in found:
            scores = innovations.beside(learnt.span)
            weighed.append(cls(screen, learnt, innovations, scores, scores.against(base)))
        weighed.sort(key=lambda one: one.evidence.spread - one.evidence.difference)
        if not weighed:
            return []
        best = weighed[0]
        alike = tuple(one.text for one in weighed[1:] if not best.scores.against(one.scores).told)
        return [cls(screen, best.learnt, innovations, best.scores, best.evidence, alike), *weighed[1:]]

    @property
    def of_the_drive(self) -> bool:
        """Whether it is about how the command becomes a force."""
        return self.learnt.shape.of in DRIVE_CURVES

    @property
    def worth(self) -> float:
        """All of it: a force that is learnt from errors one sample ahead is a small part of them, however large."""
        return 1.0

    @property
    def text(self) -> str:
        """In words."""
        return self.learnt.shape.text

    def imitated_by(self, one: Weighed[Refit]) -> bool:
        """Whether nothing is left of an effect beside the curve, and it is none of the curve's own kind.

        What is itself little else than a force over velocity, position or command may be one of several.
        """
        proposal = one.proposals[-1]
        fitted = effect_parameters(one.fit.model, proposal.name)
        change = self.screen.moved(proposal, {name: float(entry["value"]) for name, entry in fitted.items()})
        if change is None:
            return False
        own = change - self.screen.basis @ (self.screen.basis.T @ change)
        rest = own - self.learnt.span @ (self.learnt.span.T @ own)
        if not self.learnt.shape.coefficient and float(rest @ rest) < _OF_ITS_KIND * float(own @ own):
            return False
        both = self.innovations.beside(np.column_stack([self.learnt.span, rest]))
        return not both.against(self.scores).told

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""
        return unknown_structure(self.screen, self.learnt, p_value, self.rivals)
