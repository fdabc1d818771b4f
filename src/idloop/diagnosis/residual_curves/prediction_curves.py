"""Residual curves fitted to prediction errors, and evaluated like effects: on samples that no fit has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.evidence.predictive import Evidence, Scores
from idloop.diagnosis.residual_curves.trial_curves import TrialCurve, coefficient_trials, force_trials
from idloop.diagnosis.residual_curves.unknown_structure import RECORD, UnknownStructure
from idloop.diagnosis.screening.innovation_scores import InnovationScores
from idloop.diagnosis.screening.score_test import Screen
from idloop.diagnosis.search.step import EvaluatedModel
from idloop.estimation.likelihood.heteroscedasticity import segment_starts
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.statistics.truncated import directions

Array = NDArray[np.float64]

# A height with less than this part of the largest influence on the errors is unknown.
_LEAST_INFLUENCE = 1e-3
# Directions weaker than this part of the strongest are left out.
_LEAST_WEIGHT = 1e-2


@dataclass(frozen=True)
class FittedCurve:
    """A curve with its fitted heights and their standard errors; NaN where these have no influence on the errors."""

    curve: TrialCurve
    value: Array
    spread: Array
    # Orthonormal directions of the whitened errors that the curve reaches beside the free parameters.
    span: Array
    # Squared whitened errors that it explains, and their share of all.
    power: float
    share: float
    # p-value among white errors whose variance may change along the curve.
    chance: float


def fitted_curves(screen: Screen, level: float) -> list[FittedCurve]:
    """Significant curves of force, command and coefficients, best first.

    `level` is the probability of one among white errors, of which both kinds have half.
    """
    found: list[FittedCurve] = []
    for trials in (force_trials(screen), coefficient_trials(screen)):
        fits = [fit for fit in in_parallel(partial(_fit, screen), trials) if fit is not None]
        found += [fit for fit in fits if fit.chance * len(fits) * fit.curve.tried < 0.5 * level]
    # Twice the log-likelihood, less what so many directions gain by chance (Akaike).
    return sorted(found, key=lambda one: 2.0 * one.span.shape[1] - one.power)


def _fit(screen: Screen, curve: TrialCurve) -> FittedCurve | None:
    """Least squares of a curve's heights on the errors, with what the free parameters do projected out.

    None where the curve cannot be simulated, or has no influence on the errors.
    """
    from scipy.special import fdtrc  # scipy.stats takes half a second to import

    columns = [curve.change(hat) for hat in curve.step * np.eye(len(curve.knots) - curve.closed)]
    if any(column is None for column in columns):
        return None
    raw = np.column_stack([column for column in columns if column is not None])
    own, errors = raw - screen.basis @ (screen.basis.T @ raw), screen.errors
    if curve.coefficient or curve.over == RECORD:
        # A constant change of the coefficient belongs to its parameter, and a constant force to an effect.
        level = np.sum(own, axis=1)
        level /= max(float(np.linalg.norm(level)), 1e-300)
        own, errors = own - np.outer(level, level @ own), errors - level * float(level @ errors)
    size = np.linalg.norm(own, axis=0)
    known = size > _LEAST_INFLUENCE * max(float(np.max(size)), 1e-300)
    if not np.any(known):
        return None
    scaled = own[:, known] / size[known]
    vectors, weight = directions(scaled.T @ scaled, _LEAST_WEIGHT)
    left = scaled @ (vectors / weight)
    scores = -(left.T @ errors)
    rest = errors + left @ scores
    freedom = max(len(rest) - len(scores) - screen.basis.shape[1], 1)
    variance = float(rest @ rest) / freedom
    # Heteroscedasticity along the curve would make its standard errors too small.
    meat = (left * rest[:, None] ** 2).T @ left
    sums = np.add.reduceat(left * rest[:, None], segment_starts(len(rest)), axis=0)
    uneven = max(1.0, *(float(np.max(np.linalg.eigvalsh(m))) / variance for m in (meat, sums.T @ sums)))
    solve = (vectors / weight) / size[known][:, None] * curve.step
    value, spread = np.full((2, len(known)), np.nan)
    value[known] = solve @ scores
    spread[known] = np.sqrt(np.sum(solve**2, axis=1) * variance * uneven)
    power = float(scores @ scores)
    share = power / max(float(screen.errors @ screen.errors), 1e-300)
    chance = float(fdtrc(len(scores), freedom, power / len(scores) / (variance * uneven)))
    return FittedCurve(curve, value, spread, np.ascontiguousarray(left), power, share, chance)


@dataclass(frozen=True)
class PredictionCurve:
    """A curve that the errors of a screened model follow, with the evidence against that model without it."""

    screen: Screen
    fitted: FittedCurve
    innovations: InnovationScores
    scores: Scores
    evidence: Evidence
    # Other curves that tie with it, in words.
    rivals: tuple[str, ...] = ()

    @property
    def improvement(self) -> float:
        """0 for a force next to nothing beside the drive's; else 1: errors one sample ahead show little of any."""
        value, curve = self.fitted.value, self.fitted.curve
        # The mean of a coefficient is the model's own parameter.
        height = value - np.nanmean(value) if curve.coefficient else value
        return 0.0 if float(np.nanmax(np.abs(height))) <= curve.step else 1.0

    @classmethod
    def evaluated(
        cls, screen: Screen, found: Sequence[FittedCurve], innovations: InnovationScores
    ) -> list[PredictionCurve]:
        """Curves with their evidence, best first; `innovations` are those of the model that was screened."""
        base, evaluated = innovations.beside(np.zeros((len(innovations.errors), 0))), []
        for fitted in found:
            scores = innovations.beside(fitted.span)
            evaluated.append(cls(screen, fitted, innovations, scores, scores.against(base)))
        evaluated.sort(key=lambda one: one.evidence.spread - one.evidence.difference)
        if evaluated:
            ties = tuple(
                one.text for one in evaluated[1:] if not evaluated[0].scores.against(one.scores).distinguishable
            )
            evaluated[0] = replace(evaluated[0], rivals=ties)
        return evaluated

    @property
    def of_the_drive(self) -> bool:
        """Whether it describes the drive, from command to force."""
        return self.fitted.curve.of_the_drive

    @property
    def text(self) -> str:
        """In words."""
        return self.fitted.curve.text

    def confounds(self, one: EvaluatedModel[Refit]) -> bool:
        """Whether nothing remains of an effect beside the curve, and it is no curve over the same variable itself."""
        proposal = one.proposals[-1]
        fitted = effect_parameters(one.fit.model, proposal.name)
        change = self.screen.response_to_effect(
            proposal, {name: float(entry["value"]) for name, entry in fitted.items()}
        )
        if change is None:
            return False
        span, own = self._second_order, self._beside_parameters(change)
        rest = own - span @ (span.T @ own)
        if not self.fitted.curve.coefficient and float(rest @ rest) < 0.5 * float(own @ own):
            return False
        both = self.innovations.beside(np.column_stack([span, rest]))
        return not both.against(self.innovations.beside(span)).distinguishable

    def _beside_parameters(self, change: Array) -> Array:
        return np.asarray(change - self.screen.basis @ (self.screen.basis.T @ change))

    @cached_property
    def _second_order(self) -> Array:
        """The directions of the curve, and that of what its fitted heights change beyond them.

        To first order in its heights, a large curve leaves an error that effects seem to explain.
        """
        change = self.fitted.curve.change(self._strength * np.nan_to_num(self.fitted.value))
        if change is None:
            return self.fitted.span
        own = self._beside_parameters(change)
        beyond = own - self.fitted.span @ (self.fitted.span.T @ own)
        size = float(np.linalg.norm(beyond))
        return np.column_stack([self.fitted.span, beyond / size]) if size > 0.0 else self.fitted.span

    def unknown(self, p_value: float) -> UnknownStructure:
        """As a diagnosis reports it."""
        from scipy.special import ndtri

        fitted, curve = self.fitted, self.fitted.curve
        value = self._strength * fitted.value
        if curve.coefficient:
            # The mean of a coefficient is the model's own parameter.
            value = value - float(np.mean(value[np.isfinite(value)]))
        # The knots span a period that the data have shown, not one that is known, such as a turn.
        period = float(curve.knots[-1] - curve.knots[0]) if curve.closed and not curve.coefficient else None
        band = float(ndtri(0.975)) * fitted.spread
        found = curve.structure("the errors", p_value, value, band, fitted.share, period)
        ties = f"; this data cannot tell it from {', '.join(self.rivals)}" if self.rivals else ""
        return replace(found, text=found.text + ties, rivals=self.rivals)

    @cached_property
    def _strength(self) -> float:
        """Factor of the fitted curve that explains most with the noise model held.

        The projection in the fit also lets the noise model change, which underestimates the force.
        """
        from scipy.optimize import minimize_scalar

        def left(share: float) -> float:
            change = self.fitted.curve.change(share * np.nan_to_num(self.fitted.value))
            if change is None:
                return np.inf
            errors = self.screen.beside_parameters(self.screen.whitened + change)
            return float(errors @ errors)

        found = minimize_scalar(left, bounds=(0.0, 2.0), method="bounded", options={"xatol": 0.05, "maxiter": 10})
        return float(found.x) if found.fun < left(1.0) else 1.0
