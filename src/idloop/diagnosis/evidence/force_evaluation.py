"""Models with one further effect, or with two, fitted to a force balance and scored on samples they have not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import Scores, scores_of, scores_without_refit
from idloop.diagnosis.screening.force_screen import STARTS, Promising, fit_in, loses_inertia
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.search.step import LEAST_GAIN, EvaluatedModel
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, common_conditions
from idloop.estimation.force_balance.weak_fit import (
    RANKING_TOLERANCE,
    WeakFit,
    relative_errors,
    typical_errors,
    typical_sizes_of,
    with_rest_speed,
)
from idloop.estimation.force_balance.weak_form import WeakForm, weak_form
from idloop.estimation.force_balance.weak_likelihood import cost_at
from idloop.estimation.likelihood.estimation_problem import ENOUGH, EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model

Array = NDArray[np.float64]
# Effects, and the model that has them fitted.
FittedEffects = tuple[tuple[Proposal, ...], WeakFit]
# The same, and how it is scored.
_Scored = tuple[tuple[Proposal, ...], WeakFit, Callable[[WeakFit], Scores]]

# An effect must show this part of its improvement on held-out records, if it changes the forces there by so much.
CARRIES_OVER = 0.25
# A fit from several starts continues from the best after so many iterations.
_FIRST_ROUNDS = 3
# Where it enlarges errors there, by at most this part of what it takes from those of the fitted records.
_LITTLE_HARM = 0.5


def _cost_in(form: WeakForm, shift: float, model: Model) -> float:
    """Cost of a model in the windows of another one, not fitted."""
    form = form.with_engine(CachingEngine(model))
    return cost_at(form, np.append(model.theta, shift) if form.free_timing else model.theta)


def fit_promising(parent: WeakFit, promising: Promising) -> FittedEffects | None:
    """The model with an effect, fitted in the windows of its parent."""
    form, shift = parent.form, parent.shift
    models = [promising.proposal.model(trial) for trial in promising.starts]
    models.sort(key=partial(_cost_in, form, shift))
    fits = [fit_in(form, model, shift, rounds=_FIRST_ROUNDS) for model in models[:STARTS]]
    best = max((fit for fit in fits if fit is not None), key=lambda fit: fit.log_likelihood, default=None)
    if best is None:
        return None
    if not best.converged:
        best = fit_again(best, form) or best
    return (promising.proposal,), with_rest_speed(best, RANKING_TOLERANCE)


def fit_again(fit: WeakFit, form: WeakForm, tolerance: float = RANKING_TOLERANCE) -> WeakFit | None:
    """The model of a fit, fitted on from there in other windows."""
    return fit_in(form.with_rest_speed(fit.form.rest_speed), fit.model, fit.shift, tolerance)


def fit_pair(parent: WeakFit, pair: tuple[EvaluatedModel[WeakFit], EvaluatedModel[WeakFit]]) -> FittedEffects | None:
    """A model with two effects, fitted from the values of each of them alone."""
    one, other = pair
    (wanted,) = other.proposals
    prefix = f"{wanted.name}."
    values = {n[len(prefix) :]: v for n, v in other.fit.model.values.items() if n.startswith(prefix)}
    form = parent.form.with_rest_speed(max(one.fit.form.rest_speed, other.fit.form.rest_speed))
    for proposal in proposals(one.fit.model, [wanted.name], common_conditions(parent.form.data)):
        fit = fit_in(form, proposal.model(proposal.inside(values)), parent.shift)
        if fit is not None:
            return (*one.proposals, proposal), with_rest_speed(fit, RANKING_TOLERANCE)
    return None


def log_mean(relatives: Array) -> float:
    """Mean logarithm of the relative force error of the bodies."""
    return float(np.mean(np.log(np.maximum(relatives, 1e-300))))


def _typical(fit: WeakFit) -> float:
    """Geometric mean of the bodies' typical force errors where they were fitted, relative."""
    return math.exp(log_mean(typical_errors(fit.form, fit.theta, fit.shift)))


def along_fit(form: WeakForm, fit: WeakFit) -> WeakForm:
    """Windows with the model and the rest speed of a fit."""
    return form.with_engine(fit.form.engine).with_rest_speed(fit.form.rest_speed)


def scores_or_none(fit: WeakFit, scored_by: Callable[[WeakFit], Scores]) -> Scores | None:
    """Scores of a fit; None where they cannot be computed."""
    try:
        scores = scored_by(fit)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return scores if np.all(np.isfinite(scores.log_density)) else None


class Evaluator:
    """Evaluates fitted models against one without their effects: all in few windows, the best in all windows."""

    def __init__(
        self, estimation: EstimationProblem, parent: WeakFit, coarse: WeakFit, held_out: Sequence[Data]
    ) -> None:
        self.estimation, self.parent, self.base = estimation, parent, scores_of(parent)
        self.coarse = coarse
        form = weak_form(parent.form.engine, held_out, parent.form.width) if held_out else None
        self._held_out = None if form is None else form.subsampled(ENOUGH)
        self._before, self._relative = self._errors(parent)
        self._resolved = estimation.resolves(parent.model)

    def _errors(self, fit: WeakFit) -> tuple[float, float]:
        """Mean logarithms of the bodies' typical and rms force errors on the held-out records, relative."""
        if self._held_out is None:
            return 0.0, 0.0
        form = along_fit(self._held_out, fit)
        typical, relative = (measure(form, fit.theta, fit.shift) for measure in (typical_errors, relative_errors))
        return log_mean(typical), log_mean(relative)

    def __call__(self, fits: Iterable[FittedEffects | None], level: float) -> list[EvaluatedModel[WeakFit]]:
        """Those of models fitted in few windows that explain anything, with their evidence."""
        fitted = [one for one in fits if one is not None]
        if self.coarse is self.parent:
            return self._all((*one, scores_of) for one in fitted)
        seen = [(chosen, fit, scores_or_none(fit, scores_of)) for chosen, fit in fitted]
        known = [scores for *_, scores in seen if scores is not None]
        best = max(known, key=lambda scores: float(np.sum(scores.log_density)), default=None)

        def on(one: tuple[tuple[Proposal, ...], WeakFit, Scores | None]) -> _Scored | None:
            chosen, fit, scores = one
            if scores is None or best is None:
                return None
            ahead = best.against(scores)
            if ahead.distinguishable and ahead.log > math.log(1.0 / level):
                # Far behind the best: it keeps its values, which most of the other windows had no part in.
                return chosen, fit.along(along_fit(self.parent.form, fit)), scores_without_refit
            further = fit_again(fit, self.parent.form)
            return None if further is None else (chosen, further, scores_of)

        return self._all(one for one in in_parallel(on, seen) if one is not None)

    def _all(self, scored: Iterable[_Scored]) -> list[EvaluatedModel[WeakFit]]:
        return [one for one in in_parallel(self._evaluate, list(scored)) if one is not None]

    def _evaluate(self, scored: _Scored) -> EvaluatedModel[WeakFit] | None:
        chosen, fit, scored_by = scored
        gain = fit.log_likelihood - self.parent.log_likelihood
        if gain < LEAST_GAIN or loses_inertia(fit, self.parent):
            return None
        if self._resolved and not self.estimation.resolves(fit.model):
            return None
        scores = scores_or_none(fit, scored_by)
        if scores is None:
            return None
        held_out, as_fitted = None, False
        try:
            typical, relative = self._errors(fit)
        except (IdloopError, np.linalg.LinAlgError):
            return None
        evidence = scores.against(self.base)
        if self._can_improve(chosen, fit) >= CARRIES_OVER * evidence.improvement:
            grown = max(typical - self._before, relative - self._relative)
            # An error that has grown by a factor of e⁵⁰ has diverged.
            held_out = 1.0 - math.exp(min(grown, 50.0))
            as_fitted = self._as_fitted(fit, typical)
        return EvaluatedModel(chosen, fit, scores, evidence, gain, held_out, as_fitted)

    def _as_fitted(self, fit: WeakFit, after: float) -> bool:
        """Whether errors on held-out records are no larger than on the worst fitted one, and have hardly grown.

        `after` is the logarithm of their typical error. It may grow by a part of what the fitted records gain.
        """
        if self._held_out is None:
            return False
        held_out = along_fit(self._held_out, fit).residual(fit.theta, fit.shift)
        records = [fit.residual[first:last] for first, last in pairwise(fit.form.starts)]
        worst = max(log_mean(typical_sizes_of(left)) for left in records)
        gained = _typical(self.parent) - _typical(fit)
        grown = math.exp(min(after, 50.0)) - math.exp(self._before)
        return log_mean(typical_sizes_of(held_out)) <= worst and grown <= _LITTLE_HARM * gained

    def _can_improve(self, chosen: tuple[Proposal, ...], fit: WeakFit) -> float:
        """Part by which effects reduce the errors on the held-out records if they are true: a limit may not be reached.

        NaN without such records.
        """
        if self._held_out is None:
            return math.nan
        form = along_fit(self._held_out, fit)
        # The second of a pair may have replaced the first.
        there = [proposal.name for proposal in chosen if proposal.name in fit.model.effect_names]
        model = fit.model.without_effects(there)
        without = form.with_engine(CachingEngine(model))
        left, other = form.residual(fit.theta, fit.shift), without.residual(model.theta, fit.shift)
        size = float(np.linalg.norm(left))
        return 1.0 - size / max(math.hypot(size, float(np.linalg.norm(other - left))), 1e-300)
