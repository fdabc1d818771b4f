"""One step of a diagnosis by the force balance: which effects explain force on samples that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import Scores, scores_of, seen_scores
from idloop.diagnosis.identifiability import Gate, excitation_findings
from idloop.diagnosis.options import FORCE
from idloop.diagnosis.residual_curves.force_structure import ForceCurve, structures
from idloop.diagnosis.residual_curves.periods import harmonics
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.diagnosis.search.step import ADEQUATE, FAR_MORE, UNKNOWN, Step, View, Weighed
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, common_conditions
from idloop.estimation.force_balance.weak_fit import (
    MOST_ITERATIONS,
    RANKING_TOLERANCE,
    TOLERANCE,
    WeakFit,
    cost_at,
    fit_by_force,
    fit_weak,
    with_rest_speed,
)
from idloop.estimation.force_balance.weak_form import WeakForm, weak_form
from idloop.estimation.likelihood.estimation_problem import ENOUGH, EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.effect import INPUT, OUTPUT
from idloop.physics.model import Model
from idloop.physics.trial import Trial

Array = NDArray[np.float64]
# Effects, and the model that has them fitted.
_Fitted = tuple[tuple[Proposal, ...], WeakFit]
# The same, and how it is scored.
_Scored = tuple[tuple[Proposal, ...], WeakFit, Callable[[WeakFit], Scores]]

# Effects that are fitted: those whose trace promises most.
FITTED = 10
# ... of these so many, and others that promise this part of the best.
_FEWEST, _WORTH_A_FIT = 4, 0.02
# Alternatives of one effect from which a fit begins, and pairs that are tried of the best effects.
_STARTS, _IN_PAIRS = 2, 4
# Two effects that show only together explain this part of the error: a patch of two makes any error a little smaller.
_TOGETHER = 0.5
# A fit from several starts goes on from the best after so many iterations.
_FIRST_ROUNDS = 3
# Inertia beside an effect is at least this part of that without it, when a start is chosen.
_LEAST_INERTIA = 1e-3
# Part of a trace that must not be the free parameters' own.
_OWN_PART = 3e-3
# Effects are fitted at a glance first, in so many windows: the best few go on to all in which they are weighed.
_GLANCE = 2_000
# A model that leaves less than this part of the drive's force is adequate where no effect explains more.
_ADEQUATE = 0.1
# Held-out records must show this part of what an effect does where it was fitted.
_CARRIES_OVER = 0.25
# ... where it changes the forces by this part of what is unexplained.
_ACTS = 0.1
# An error that has grown by more than this [log] is as bad.
_WORST = 50.0
# Least log-likelihood that a trace must promise.
_LEAST_PROMISE = 2.0


@dataclass(frozen=True)
class ForceStep(Step[WeakFit]):
    """What one step has weighed by the balance of forces."""

    subsampled: WeakFit = field(kw_only=True)  # the parent, fitted to the windows in which the effects are weighed
    # The same effects beside a curve that explains far more than any of them; empty where there is none.
    beside: tuple[Weighed[WeakFit], ...] = ()

    @property
    def criterion(self) -> str:
        """What the models are measured by."""
        return FORCE

    def smaller(self, one: Weighed[WeakFit]) -> float:
        """Part by which it makes errors smaller: the least of those on samples not seen and all.

        The user looks at the unexplained part of the drive's force: what shrinks both alike explains nothing.
        """
        relative = 1.0 - math.exp(_typical(one.fit.relative_by_body) - _typical(self.subsampled.relative_by_body))
        return min(one.evidence.improvement, relative)

    def worth(self, one: Weighed[WeakFit]) -> bool:
        """Whether it makes errors enough smaller, on held-out records as well."""
        return super().worth(one) and self._carries_over(one)

    def _carries_over(self, one: Weighed[WeakFit]) -> bool:
        return one.held_out is None or one.held_out >= max(_CARRIES_OVER * self.smaller(one), self.least)

    @cached_property
    def eligible(self) -> list[Weighed[WeakFit]]:
        """What shows and is worth naming, beside a curve that explains far more where there is one."""
        return self.worthy(self.beside) if self.beside else super().eligible

    def _stands_in(self, one: Weighed[WeakFit]) -> bool:
        if self.beside:
            return all(one.names != other.names for other in self.eligible)
        return super()._stands_in(one)

    def only_together(self, pair: Weighed[WeakFit]) -> bool:
        """Whether two effects explain together what neither does alone."""
        return self.smaller(pair) >= _TOGETHER

    def too_small(self, one: Weighed[WeakFit]) -> str:
        """Why an effect that shows is not worth a name."""
        part = self.smaller(one)
        if part >= self.least and one.held_out is not None:
            return (
                f"it makes the unexplained force smaller by {100.0 * part:.2g} % where it was fitted, and by "
                f"{100.0 * one.held_out:.2g} % on the held-out records: it does not carry over"
            )
        return (
            f"it makes the unexplained force smaller by {100.0 * max(part, 0.0):.2g} % only, and "
            f"{100.0 * self.least:g} % is asked for"
        )

    def reported(self, fit: WeakFit) -> Model:
        """A fitted model with its standard errors; what was only ranked is fitted to the end, to all windows, first."""
        if any(fit is one.fit for one in self.weighed):
            fit = _again(fit, self.parent.form, TOLERANCE) or fit
        return fitted_model(fit)

    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """What is left, judged by the drive's force."""
        fit = self.parent
        if self.structure is not None:
            return UNKNOWN, ()
        worst = int(np.argmax(fit.relative_by_body))
        if fit.relative_by_body[worst] < _ADEQUATE or not fit.model_error_dominates:
            return ADEQUATE, ()
        force = "drive force" if worst == 0 else f"force on {fit.model.bodies[worst]}"
        text = (
            f"{100.0 * fit.relative_by_body[worst]:.3g} % of the {force} stays unexplained, which sensor noise does not"
            " account for: no effect that was looked for explains more of it on samples that the fit has not seen"
        )
        return UNKNOWN, (text,)


def fitted_model(fit: WeakFit) -> Model:
    """The model with its fitted values and their standard errors."""
    model, variance = fit.model, np.diag(fit.covariance)
    errors = {n: float(np.sqrt(v)) for n, v in zip(model.free, variance, strict=False) if np.isfinite(v) and v >= 0.0}
    return model.with_values({}, errors)


class ForceView(View[WeakFit]):
    """Weighs what could be added to a model by its force balance.

    On held-out records an effect has to explain something, too. Windows that are made anew are added to ``forms``, by
    their width.
    """

    def __init__(
        self,
        estimation: EstimationProblem,
        level: float,
        least: float,
        effects: Sequence[str] | None = None,
        held_out: Sequence[Data] = (),
        forms: dict[int, WeakForm] | None = None,
    ) -> None:
        self.estimation, self.level, self.least, self.effects = estimation, level, least, effects
        self.held_out, self._forms = tuple(held_out), {} if forms is None else forms

    def weigh(self, parent: WeakFit) -> Step[WeakFit]:
        """Weigh every effect of the catalogue, and pairs of them where none shows alone."""
        whole, parent = parent, parent.subsampled(ENOUGH)
        model, glance = parent.model, parent.subsampled(_GLANCE)
        screen = _Screen(self.estimation, parent, glance)
        asked = proposals(model, self.effects, self.estimation.conditions)
        choices = [one for one in asked if _balances(one)]
        screened = list(in_parallel(screen, choices))
        promising = [found for found in screened if found.starts]
        promising.sort(key=lambda found: -found.promise)
        worth = _WORTH_A_FIT * promising[0].promise if promising else 0.0
        chosen = promising[:_FEWEST] + [found for found in promising[_FEWEST:FITTED] if found.promise >= worth]
        parts = {part for found in chosen for part in found.proposal.effect.contains}
        chosen += [found for found in promising if found.proposal.effect.name in parts and found not in chosen]
        weigher = _Weigher(self.estimation, parent, glance, self.held_out)
        weighed = weigher(in_parallel(partial(_fitted, glance), chosen), self.level)
        step = ForceStep(
            whole, tuple(weighed), len(choices) + screen.waves, self.level, self.least, tuple(asked), subsampled=parent
        )
        design = min((one.evidence.design_effect for one in weighed), default=1.0)
        testable, why = _testable(asked, screened, design * step.threshold())
        curves = structures(parent)
        beside = _beside(curves, weighed)
        pairs = [] if beside else weigher(in_parallel(partial(_pair, glance), _pairs(step)), self.level)
        return replace(
            step,
            weighed=(*weighed, *pairs),
            gate=Gate(excitation_findings(model, self.estimation), testable, why),
            structures=tuple(curves),
            beside=tuple(beside),
        )

    def best_with(self, parent: WeakFit, name: str, at: str) -> WeakFit | None:
        """The model with one effect, from where the unexplained force promises most of it; None where it does not."""
        screen = _Screen(self.estimation, parent, parent)
        for proposal in proposals(parent.model, [f"{name}@{at}"], self.estimation.conditions):
            fitted = _fitted(parent, screen(proposal)) if _balances(proposal) else None
            if fitted is not None:
                return fitted[1]
        return None

    def again(self, fit: WeakFit) -> WeakFit:
        """The same model in windows as wide as its noise asks for."""
        form = fit.form
        # The less a model leaves, the wider are the windows in which sensor noise is a small part of that.
        found = fit_by_force(
            form.engine, self.estimation.data, fit.theta, self._forms, accept_noise=True, rest_speed=form.rest_speed,
            narrowest=form.width,
        )  # fmt: skip
        return found or fit

    def without(self, fit: WeakFit, name: str) -> WeakFit | None:
        """The model without one of its effects, where that says as much of unseen samples; None where it does not."""
        fit = fit.subsampled(ENOUGH)
        smaller = fit_in(fit.form, fit.model.without_effect(name), fit.shift)
        if smaller is None:
            return None
        try:
            evidence = scores_of(fit).against(scores_of(smaller))
        except (IdloopError, np.linalg.LinAlgError):
            return None
        worth = evidence.improvement >= self.least and evidence.log >= math.log(1.0 / self.level)
        return None if worth else self.again(smaller)


def _pairs(step: Step[WeakFit]) -> list[tuple[Weighed[WeakFit], Weighed[WeakFit]]]:
    """Which of the effects that were fitted alone are tried together.

    The best few, where none shows alone; else, where the best contains a plainer one, that one with each of the others:
    a plain effect beside another plain one may be the same equation.
    """
    singles = list(step.weighed)
    if not step.tied:
        best = sorted(singles, key=lambda one: -one.gain)[:_IN_PAIRS]
        return [(a, b) for place, a in enumerate(best) for b in best[place + 1 :]]
    if step.tied[0].proposals[0].replaces is not None:
        return []
    plain = [one for one in singles if step.tied[0].contains(one)]
    others = [one for one in singles if not one.proposals[0].effect.contains]
    return [(a, b) for a in plain for b in others if b is not a and b.proposals[0].replaces is None]


def _beside(curves: Sequence[ForceCurve], weighed: Sequence[Weighed[WeakFit]]) -> list[Weighed[WeakFit]]:
    """Effects beside a curve over the position that explains far more than any of them: they may stand in for it."""
    if not curves or not weighed or not curves[0].imitated:
        return []
    curve, best = curves[0], max(weighed, key=lambda one: one.evidence.difference)
    if curve.evidence.difference < FAR_MORE * best.evidence.difference or not curve.scores.against(best.scores).told:
        return []
    return [curve.beside(one) for one in weighed]


def _balances(proposal: Proposal) -> bool:
    """Whether a force balance along the measured motion can show an effect."""
    return proposal.effect.site != OUTPUT and not proposal.effect.splits


def unbalanced(model: Model, effects: Sequence[str] | None, conditions: Mapping[str, str], weighed: Model) -> list[str]:
    """Names of the effects that could be added to a model and that the balance of another one does not show.

    `weighed` is that one: without the bodies and couplings that the model has gained since.
    """
    return [
        one.name
        for one in proposals(model, effects, conditions)
        if not _balances(one)
        # A balance finds the time at which commands act by itself, and sees little of their quick changes.
        or (one.effect.site == INPUT and one.effect.lags)
        or one.at not in weighed.sites(one.effect.site)
    ]


@dataclass(frozen=True)
class _Promising:
    proposal: Proposal
    promise: float
    worth: float
    left: float
    starts: list[Trial]


class _Screen:
    """Correlates the traces that effects would leave in a balance with what it leaves unexplained.

    Traces are computed in the windows of `parent`, some of those of `whole`.
    """

    def __init__(self, estimation: EstimationProblem, whole: WeakFit, parent: WeakFit) -> None:
        self.parent, self.model = parent, (model := parent.model)
        self._share = len(parent.rows) / len(whole.rows)
        self.sizes = Sizes(model, estimation)
        _, slopes = parent.linear
        self._size = np.sqrt(np.mean(parent.residual**2, axis=0))
        self.errors = (parent.residual / self._size).ravel()
        slopes = slopes.reshape(-1, slopes.shape[-1])
        norms = np.linalg.norm(slopes, axis=0)
        left, weight, right = np.linalg.svd(slopes / np.where(norms > 0.0, norms, 1.0), full_matrices=False)
        known = weight > 1e-6 * np.max(weight, initial=0.0)
        self.basis = left[:, known]
        self.errors = self.errors - self.basis @ (self.basis.T @ self.errors)
        self._inertia = np.zeros(len(self.basis))
        name = f"{model.bodies[0]}.inertia"
        if name in model.free:
            place = model.free.index(name)
            self._inertia = self.basis @ (right[known, place] / weight[known]) / (norms[place] * model.values[name])
        found = {body: harmonics(whole, index) for index, body in enumerate(model.bodies)}
        self._harmonics = {body: several for body, (several, _) in found.items()}
        self.waves = sum(tried for _, tried in found.values())

    def __call__(self, proposal: Proposal) -> _Promising:
        """What an effect promises, and from where its fit begins; nowhere where it promises nothing."""
        scales = self.sizes.at(proposal.effect.site, proposal.at)
        scales = replace(scales, harmonics=self._harmonics.get(proposal.at, ()))
        found, worth, part = [], 0.0, 0.0
        for trials in proposal.alternatives(scales):
            columns = [self._trace(proposal, trial) for trial in trials]
            if any(column is None for column in columns):
                continue
            raw = np.stack([column for column in columns if column is not None]).T
            own = raw - self.basis @ (self.basis.T @ raw)
            powers = np.sum(own**2, axis=0)
            worth = max(worth, 0.5 * float(np.max(powers)) / self._share)
            part = max(part, float(np.max(powers / np.maximum(np.sum(raw**2, axis=0), 1e-300))))
            size, *_ = np.linalg.lstsq(own, -self.errors, rcond=1e-6)
            if len(trials) == 1 and proposal.one_sided:
                size = np.maximum(size, 0.0)
            promise = self._promise(own @ size)
            if np.isfinite(promise):
                # What has no strength of its own, such as a limit, begins as it was tried.
                whole = len(trials) == 1 and proposal.weaker(trials[0], 0.5) == trials[0]
                found.append((self._promise_of_all(raw[:, 0], own[:, 0]) if whole else promise, promise, trials, size))
        most = max((promise for _, promise, *_ in found), default=0.0)
        if most < _LEAST_PROMISE:
            return _Promising(proposal, 0.0, worth, part, [])
        found.sort(key=lambda one: -one[0])
        starts = [start for *_, trials, size in found[:_STARTS] for start in _starts(proposal, trials, size)]
        return _Promising(proposal, most, worth, part, starts)

    def _promise(self, change: Array) -> float:
        """Log-likelihood that a change of the errors is worth."""
        left = self.errors + change
        return 0.5 * float(self.errors @ self.errors - left @ left) / self._share

    def _promise_of_all(self, raw: Array, own: Array) -> float:
        """The same for all that an effect does: what switches the command off leaves the whole acceleration."""
        inertia = max(1.0 - float(self._inertia @ raw), _LEAST_INERTIA)
        left = (self.errors + own) / inertia
        return 0.5 * float(self.errors @ self.errors - left @ left) / self._share

    def _trace(self, proposal: Proposal, trial: Trial) -> Array | None:
        model = proposal.model(trial)
        form = self.parent.form.with_engine(CachingEngine(model))
        try:
            residual = form.residual(model.theta, self.parent.shift)
        except IdloopError:
            return None
        change = ((residual - self.parent.residual) / self._size).ravel()
        return change if np.all(np.isfinite(change)) else None


def _testable(
    asked: Sequence[Proposal], screened: Sequence[_Promising], threshold: float
) -> tuple[dict[str, str], dict[str, str]]:
    """Whether the balance could show each effect, and why: what acts in sensors or splits a body is beyond it."""
    testable, why = {}, {}
    for one in screened:
        name = one.proposal.name
        if one.left < _OWN_PART:
            testable[name], why[name] = "no", "on this data it does no more than the free parameters can do"
        elif one.worth < threshold:
            testable[name], why[name] = "no", "at its usual size it explains too little force to show"
        else:
            testable[name] = "weak" if one.proposal.effect.from_a_level else "yes"
            why[name] = f"at its usual size it would be worth {one.worth:.3g} units of log-likelihood"
    for proposal in asked:
        if not _balances(proposal):
            testable[proposal.name] = "no"
            why[proposal.name] = "a balance of forces along the measured motion does not see it"
    return testable, why


def _starts(proposal: Proposal, trials: Sequence[Trial], size: Array) -> list[Trial]:
    """Values from which a fit begins: those tried, and what the trace promises of them."""
    if len(trials) > 1 and "phase" in trials[0]:
        # Sine and cosine: their sum is one wave.
        reach = float(np.linalg.norm(size))
        return [proposal.inside({**proposal.weaker(trials[0], reach), "phase": float(np.arctan2(size[1], size[0]))})]
    share = float(np.clip(size[0], -50.0, 50.0))
    scaled = proposal.inside(proposal.weaker(trials[0], share))
    return [trials[0]] if scaled == trials[0] else [trials[0], scaled]


def fit_in(
    form: WeakForm, model: Model, shift: float, tolerance: float = RANKING_TOLERANCE, rounds: int = MOST_ITERATIONS
) -> WeakFit | None:
    """A model fitted in the windows of another one, from its values and a time from stamp to action [s].

    None where it cannot be. A further iteration must promise `tolerance` of log-likelihood.
    """
    form = form.with_engine(CachingEngine(model))
    start = np.append(model.theta, shift) if form.free_timing else model.theta
    try:
        found = fit_weak(form, start, rounds=rounds, tolerance=tolerance)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return found if np.isfinite(found.log_likelihood) else None


def _cost_in(form: WeakForm, shift: float, model: Model) -> float:
    """How badly a model does in the windows of another one, not fitted."""
    form = form.with_engine(CachingEngine(model))
    return cost_at(form, np.append(model.theta, shift) if form.free_timing else model.theta)


def _fitted(parent: WeakFit, promising: _Promising) -> _Fitted | None:
    """The model with an effect, fitted in the windows of its parent."""
    form, shift = parent.form, parent.shift
    models = [promising.proposal.model(trial) for trial in promising.starts]
    models.sort(key=partial(_cost_in, form, shift))
    fits = [fit_in(form, model, shift, rounds=_FIRST_ROUNDS) for model in models[:_STARTS]]
    found = [fit for fit in fits if fit is not None]
    if not found:
        return None
    best = max(found, key=lambda fit: fit.log_likelihood)
    if not best.converged:
        best = _again(best, form) or best
    if promising.proposal.effect.friction is not None:
        best = with_rest_speed(best, RANKING_TOLERANCE)
    return (promising.proposal,), best


def _again(fit: WeakFit, form: WeakForm, tolerance: float = RANKING_TOLERANCE) -> WeakFit | None:
    """The model of a fit, fitted on from there in other windows."""
    return fit_in(form.with_rest_speed(fit.form.rest_speed), fit.model, fit.shift, tolerance)


class _Weigher:
    """Weighs fitted models against one without what they have: at a glance all, in all windows the best of them."""

    def __init__(
        self, estimation: EstimationProblem, parent: WeakFit, glance: WeakFit, held_out: Sequence[Data]
    ) -> None:
        self.estimation, self.parent, self.base = estimation, parent, scores_of(parent)
        self.glance = glance
        form = weak_form(parent.form.engine, held_out, parent.form.width) if held_out else None
        self._held_out = None if form is None else form.subsampled(ENOUGH)
        self._before = self._typical_error(parent)

    def _typical_error(self, fit: WeakFit) -> float:
        """Logarithm of the typical error on the held-out records, whose scale is their own."""
        if self._held_out is None:
            return 0.0
        form = self._held_out.with_engine(fit.form.engine).with_rest_speed(fit.form.rest_speed)
        return -float(np.mean(fit.along(form).log_densities()))

    def __call__(self, fits: Iterable[_Fitted | None], level: float) -> list[Weighed[WeakFit]]:
        """Of effects and models that have them fitted at a glance those that explain anything, with their evidence."""
        fitted = [one for one in fits if one is not None]
        if self.glance is self.parent:
            return self._weighed((*one, scores_of) for one in fitted)
        seen = [(chosen, fit, _scores_or_none(fit)) for chosen, fit in fitted]
        known = [scores for *_, scores in seen if scores is not None]
        best = max(known, key=lambda scores: float(np.sum(scores.log_density)), default=None)

        def on(one: tuple[tuple[Proposal, ...], WeakFit, Scores | None]) -> _Scored | None:
            chosen, fit, scores = one
            if scores is None or best is None:
                return None
            ahead = best.against(scores)
            if ahead.told and ahead.log > math.log(1.0 / level):
                # Far behind: its values are those of the glance, and the other windows have not seen them.
                form = self.parent.form.with_engine(fit.form.engine).with_rest_speed(fit.form.rest_speed)
                return chosen, fit.along(form), seen_scores
            further = _again(fit, self.parent.form)
            return None if further is None else (chosen, further, scores_of)

        return self._weighed(one for one in in_parallel(on, seen) if one is not None)

    def _weighed(self, scored: Iterable[_Scored]) -> list[Weighed[WeakFit]]:
        return [one for one in in_parallel(self._weigh, list(scored)) if one is not None]

    def _weigh(self, scored: _Scored) -> Weighed[WeakFit] | None:
        chosen, fit, scores_of_fit = scored
        gain = fit.log_likelihood - self.parent.log_likelihood
        if gain < _LEAST_PROMISE or not self.estimation.resolves(fit.model):
            return None
        try:
            scores = scores_of_fit(fit)
            after = self._typical_error(fit)
        except (IdloopError, np.linalg.LinAlgError):
            return None
        if not np.all(np.isfinite(scores.log_density)):
            return None
        held_out = 1.0 - math.exp(min(after - self._before, _WORST)) if self._acts(chosen, fit) else None
        return Weighed(chosen, fit, scores, scores.against(self.base), gain, held_out)

    def _acts(self, chosen: tuple[Proposal, ...], fit: WeakFit) -> bool:
        """Whether effects do anything on the held-out records: a limit may not be reached there."""
        if self._held_out is None:
            return False
        form = self._held_out.with_engine(fit.form.engine).with_rest_speed(fit.form.rest_speed)
        # The second of a pair may have taken the place of the first.
        there = [proposal.name for proposal in chosen if proposal.name in fit.model.effect_names]
        model = fit.model.without_effects(there)
        without = form.with_engine(CachingEngine(model))
        left, other = form.residual(fit.theta, fit.shift), without.residual(model.theta, fit.shift)
        return bool(np.linalg.norm(other - left) >= _ACTS * np.linalg.norm(left))


def _typical(relatives: Array) -> float:
    """Logarithm of the relative force error of a typical body."""
    return float(np.mean(np.log(np.maximum(relatives, 1e-300))))


def _scores_or_none(fit: WeakFit) -> Scores | None:
    try:
        scores = scores_of(fit)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return scores if np.all(np.isfinite(scores.log_density)) else None


def _pair(parent: WeakFit, pair: tuple[Weighed[WeakFit], Weighed[WeakFit]]) -> _Fitted | None:
    """A model with two effects, from where each of them went alone."""
    one, other = pair
    first = one.fit.model
    (wanted,) = other.proposals
    for proposal in proposals(first, [wanted.name], common_conditions(parent.form.data)):
        alone = other.fit.model
        prefix = f"{wanted.name}."
        values = {n[len(prefix) :]: v for n, v in alone.values.items() if n.startswith(prefix)}
        form = parent.form.with_rest_speed(max(one.fit.form.rest_speed, other.fit.form.rest_speed))
        fit = fit_in(form, proposal.model(proposal.inside(values)), parent.shift)
        if fit is not None:
            return (*one.proposals, proposal), fit
    return None
