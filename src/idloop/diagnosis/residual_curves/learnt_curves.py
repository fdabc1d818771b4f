"""Curves learnt from the errors of a prediction, weighed as effects are: by samples that no fit has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.evidence.predictive import Evidence, Scores
from idloop.diagnosis.residual_curves.curves import Shape, factor_shapes, force_shapes
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure
from idloop.diagnosis.screening.innovation_scores import InnovationScores
from idloop.diagnosis.screening.score_test import Screen
from idloop.diagnosis.search.step import Weighed
from idloop.estimation.likelihood.heteroscedasticity import stretches
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit

Array = NDArray[np.float64]

# A height that the errors feel less than this part of the most felt one is not known.
_LEAST_FELT = 1e-3
# Directions weaker than this part of the strongest are left out.
_LEAST_WEIGHT = 1e-2


@dataclass(frozen=True)
class Learnt:
    """A shape with the heights that the errors ask for and their standard errors; NaN where the errors feel nothing."""

    shape: Shape
    value: Array
    spread: Array
    # Orthonormal directions of the whitened errors that the curve reaches beside the free parameters.
    span: Array
    # Squared whitened errors that it explains, and their share of all.
    power: float
    share: float
    # Probability of as much among white errors, in their variance, which may be uneven along the curve.
    chance: float


def remaining(screen: Screen, level: float) -> list[Learnt]:
    """Curves that the errors follow, best first: forces, a command, coefficients that change.

    `level` is the probability of one among white errors, of which both kinds have half.
    """
    found: list[Learnt] = []
    for shapes in (force_shapes(screen), factor_shapes(screen)):
        fits = [fit for fit in in_parallel(partial(_learn, screen), shapes) if fit is not None]
        found += [fit for fit in fits if fit.chance * len(fits) * fit.shape.tried < 0.5 * level]
    # Twice the log-likelihood, less what so many directions gain by chance (Akaike).
    return sorted(found, key=lambda one: 2.0 * one.span.shape[1] - one.power)


def _learn(screen: Screen, shape: Shape) -> Learnt | None:
    """Least squares of a curve's heights on the errors, with what the free parameters do projected out.

    None where the curve cannot be simulated, or the errors do not feel it.
    """
    from scipy.stats import f as f_distribution

    columns = [shape.change(hat) for hat in shape.step * np.eye(len(shape.knots) - shape.closed)]
    if any(column is None for column in columns):
        return None
    raw = np.column_stack([column for column in columns if column is not None])
    own, errors = raw - screen.basis @ (screen.basis.T @ raw), screen.errors
    if shape.coefficient:
        # That it is another constant everywhere is for an effect of the catalogue, or the free parameter, to say.
        level = np.sum(own, axis=1)
        level /= max(float(np.linalg.norm(level)), 1e-300)
        own, errors = own - np.outer(level, level @ own), errors - level * float(level @ errors)
    size = np.linalg.norm(own, axis=0)
    known = size > _LEAST_FELT * max(float(np.max(size)), 1e-300)
    if not np.any(known):
        return None
    left, weight, right = np.linalg.svd(own[:, known] / size[known], full_matrices=False)
    kept = weight > _LEAST_WEIGHT * weight[0]
    left, weight, right = left[:, kept], weight[kept], right[kept]
    scores = -(left.T @ errors)
    rest = errors + left @ scores
    freedom = max(len(rest) - len(scores) - screen.basis.shape[1], 1)
    variance = float(rest @ rest) / freedom
    # Uneven variance along the curve makes it look surer than it is.
    meat = (left * rest[:, None] ** 2).T @ left
    sums = np.add.reduceat(left * rest[:, None], stretches(len(rest)), axis=0)
    uneven = max(1.0, *(float(np.max(np.linalg.eigvalsh(m))) / variance for m in (meat, sums.T @ sums)))
    solve = (right.T / weight) / size[known][:, None] * shape.step
    value, spread = np.full((2, len(known)), np.nan)
    value[known] = solve @ scores
    spread[known] = np.sqrt(np.sum(solve**2, axis=1) * variance * uneven)
    power = float(scores @ scores)
    share = power / max(float(screen.errors @ screen.errors), 1e-300)
    chance = float(f_distribution.sf(power / len(scores) / (variance * uneven), len(scores), freedom))
    return Learnt(shape, value, spread, np.ascontiguousarray(left), power, share, chance)


@dataclass(frozen=True)
class LearntCurve:
    """A curve that the errors of a screened model follow, with the evidence against that model without it."""

    screen: Screen
    learnt: Learnt
    innovations: InnovationScores
    scores: Scores
    evidence: Evidence
    # Other curves that the data cannot tell from it, in words.
    rivals: tuple[str, ...] = ()

    # All of it: a force that is learnt from errors one sample ahead is a small part of them, however large.
    worth = 1.0

    @classmethod
    def weighed(cls, screen: Screen, found: Sequence[Learnt], innovations: InnovationScores) -> list[LearntCurve]:
        """Curves with their evidence, best first; `innovations` are those of the model that was screened."""
        base, weighed = innovations.beside(np.zeros((len(innovations.errors), 0))), []
        for learnt in found:
            scores = innovations.beside(learnt.span)
            weighed.append(cls(screen, learnt, innovations, scores, scores.against(base)))
        weighed.sort(key=lambda one: one.evidence.spread - one.evidence.difference)
        if weighed:
            alike = tuple(one.text for one in weighed[1:] if not weighed[0].scores.against(one.scores).told)
            weighed[0] = replace(weighed[0], rivals=alike)
        return weighed

    @property
    def of_the_drive(self) -> bool:
        """Whether it is about how the command becomes a force."""
        return self.learnt.shape.of_the_drive

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
        if not self.learnt.shape.coefficient and float(rest @ rest) < 0.5 * float(own @ own):
            return False
        both = self.innovations.beside(np.column_stack([self.learnt.span, rest]))
        return not both.against(self.scores).told

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""
        from scipy.stats import norm

        learnt, shape = self.learnt, self.learnt.shape
        value = self._strength() * learnt.value
        if shape.coefficient:
            # The mean of a coefficient is the model's own parameter.
            value = value - float(np.mean(value[np.isfinite(value)]))
        # The knots span a period that the data have shown, not one that is known, such as a turn.
        period = float(shape.knots[-1] - shape.knots[0]) if shape.closed and not shape.coefficient else None
        band = float(norm.ppf(0.975)) * learnt.spread
        found = shape.structure("the errors", p_value, value, band, learnt.share, period)
        alike = f"; this data cannot tell it from {', '.join(self.rivals)}" if self.rivals else ""
        return replace(found, text=found.text + alike, rivals=self.rivals)

    def _strength(self) -> float:
        """How much of the learnt curve explains most beside the noise as it is.

        The projection that learns it also lets the noise model change by a little, which is no small change once the
        force is gone.
        """
        from scipy.optimize import minimize_scalar

        def left(share: float) -> float:
            change = self.learnt.shape.change(share * np.nan_to_num(self.learnt.value))
            if change is None:
                return np.inf
            errors = self.screen.beside_parameters(self.screen.whitened + change)
            return float(errors @ errors)

        found = minimize_scalar(left, bounds=(0.0, 2.0), method="bounded", options={"xatol": 0.05, "maxiter": 10})
        return float(found.x) if found.fun < left(1.0) else 1.0
