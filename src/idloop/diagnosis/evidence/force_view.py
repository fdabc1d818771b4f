"""One step of a diagnosis by the force balance: effects that explain force on samples that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import Evidence, Scores, scores_of, scores_without_refit
from idloop.diagnosis.evidence.quantisation import READINGS_OFF, readings_half_a_quantum_off
from idloop.diagnosis.evidence.undetermined_strength import undetermined_with
from idloop.diagnosis.identifiability import NOT_REPEATED, OWN_PART, Gate, excitation_findings
from idloop.diagnosis.options import FORCE, Options
from idloop.diagnosis.residual_curves.force_curves import ForceCurve, force_curves
from idloop.diagnosis.residual_curves.periods import harmonics, unexplained_period
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.diagnosis.search.step import (
    ADEQUATE,
    CONFOUNDING_RATIO,
    LEAST_GAIN,
    UNKNOWN,
    EvaluatedModel,
    SearchStep,
    View,
)
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, common_conditions
from idloop.estimation.force_balance.weak_fit import (
    MOST_ITERATIONS,
    RANKING_TOLERANCE,
    TOLERANCE,
    WeakFit,
    fit_weak,
    with_rest_speed,
)
from idloop.estimation.force_balance.weak_form import WeakForm, weak_form
from idloop.estimation.force_balance.weak_likelihood import cost_at
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.likelihood.estimation_problem import ENOUGH, EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import standard_errors
from idloop.physics.effect import INPUT, OUTPUT
from idloop.physics.model import Model, values_of
from idloop.physics.trial import Trial
from idloop.records import Record

Array = NDArray[np.float64]
# Effects, and the model that has them fitted.
_Fitted = tuple[tuple[Proposal, ...], WeakFit]
# The same, and how it is scored.
_Scored = tuple[tuple[Proposal, ...], WeakFit, Callable[[WeakFit], Scores]]

# Effects that are fitted, by what their traces promise: four always (and in pairs), others with a fiftieth of the best.
_MOST_FITS, _FEWEST_FITS, _WORTH_A_FIT = 10, 4, 0.02
# Alternatives of one effect from which a fit begins; those of other whole numbers, such as harmonics, that are fitted.
_STARTS, _WHOLE_NUMBERS = 2, 4
# Two effects that show only together reduce the error by half: any two reduce it a little.
_TOGETHER = 0.5
# A fit from several starts continues from the best after so many iterations.
_FIRST_ROUNDS = 3
# The inertia beside an effect is at least this part of that without it: what takes it away switches the command off.
_LEAST_INERTIA = 1.0 / 30.0
# Windows in which all effects are fitted first; the best are fitted again in all windows.
_COARSE_WINDOWS = 2_000
# A model that leaves less than this part of the drive's force is adequate where no effect explains more.
ADEQUATE_FORCE = 0.1
# Where no held-out record shows it, an effect explains at least this part of the power of errors beyond sensor noise:
# beside a force that no effect describes, one that follows a corner of it shows as well.
_LEAST_PART = 0.05
# An effect must show this part of its improvement on held-out records, if it changes the forces there by so much.
_CARRIES_OVER = 0.25
# Where it enlarges errors there, by at most this part of what it takes from those of the fitted records.
_LITTLE_HARM = 0.5


@dataclass(frozen=True)
class ForceStep(SearchStep[WeakFit]):
    """The models that one step has evaluated by the force balance."""

    subsampled: WeakFit = field(kw_only=True)  # the parent, fitted to the windows in which the effects are evaluated
    # The same effects beside a curve that explains far more than any of them, if there is one.
    beside: tuple[EvaluatedModel[WeakFit], ...] = ()

    @property
    def criterion(self) -> str:
        """What the models are measured by."""
        return FORCE

    def improvement(self, one: EvaluatedModel[WeakFit]) -> float:
        """Part by which it reduces errors: the smaller one of that on unseen samples and that of the force error.

        What reduces drive force and unexplained force alike explains nothing.
        """
        return _improvement(one.evidence, self.subsampled, one.fit)

    def practically_significant(self, one: EvaluatedModel[WeakFit]) -> bool:
        """Whether it reduces errors enough, on held-out records as well."""
        return super().practically_significant(one) and self._carries_over(one)

    def _part(self, one: EvaluatedModel[WeakFit]) -> float:
        """Part of the power of the errors of all bodies that it explains, of those that no noise accounts for."""
        noise = self.subsampled.noise_share
        left = max(1.0 - one.evidence.improvement, math.exp(-len(noise) * _fall(self.subsampled, one.fit)))
        return (1.0 - left**2) / max(1.0 - float(np.max(noise)) ** 2, 1e-300)

    def _carries_over(self, one: EvaluatedModel[WeakFit]) -> bool:
        """Whether the held-out records have smaller errors as well, or errors like those of the fitted ones.

        One record whose errors happened to be small says little beside many that an effect explains. Without held-out
        records, and of an effect that they do not reach, the fitted ones must show enough.
        """
        if one.held_out is None:
            return self._part(one) >= _LEAST_PART
        least = max(_CARRIES_OVER * self.improvement(one), self.minimum_improvement)
        return one.as_fitted or one.held_out >= least

    def _nearly_degenerates_to(self, rich: EvaluatedModel[WeakFit], plain: EvaluatedModel[WeakFit]) -> bool:
        """As in `SearchStep`, or what it explains beyond the other one does not carry over to the held-out records."""
        if super()._nearly_degenerates_to(rich, plain):
            return True
        if not rich.degenerates_to(plain) or rich.held_out is None or plain.held_out is None:
            return False
        beyond = 1.0 - (1.0 - rich.held_out) / (1.0 - plain.held_out)
        return beyond < _CARRIES_OVER * rich.scores.against(plain.scores).improvement

    @cached_property
    def eligible(self) -> list[EvaluatedModel[WeakFit]]:
        """As in `SearchStep`, beside a curve that explains far more where there is one."""
        return self.nameable(self.beside) if self.beside else super().eligible

    def _is_confounded(self, one: EvaluatedModel[WeakFit]) -> bool:
        if self.beside:
            return all(one.names != other.names for other in self.eligible)
        return super()._is_confounded(one)

    def jointly_needed(self, pair: EvaluatedModel[WeakFit]) -> bool:
        """Whether two effects explain together what neither does alone."""
        return self.improvement(pair) >= _TOGETHER

    def insignificance(self, one: EvaluatedModel[WeakFit]) -> str:
        """Why an effect that shows is not worth a name."""
        part = self.improvement(one)
        if part >= self.minimum_improvement:
            if one.held_out is not None:
                return (
                    f"it reduces the unexplained force by {100.0 * part:.2g} % where it was fitted, and by "
                    f"{100.0 * one.held_out:.2g} % on the held-out records: it does not carry over"
                )
            return (
                f"it explains only {100.0 * self._part(one):.2g} % of the errors beyond the sensors' noise; without a "
                f"held-out record that shows it, {100.0 * _LEAST_PART:g} % is asked for"
            )
        return (
            f"it reduces the unexplained force by {100.0 * max(part, 0.0):.2g} % only, and "
            f"{100.0 * self.minimum_improvement:g} % is asked for"
        )

    def _settled(self, fit: WeakFit) -> WeakFit:
        """A model that was only ranked is fitted to all windows."""
        ranked = any(fit is one.fit for one in self.evaluated)
        return (_refitted(fit, self.parent.form, TOLERANCE) or fit) if ranked else fit

    def reported(self, fit: WeakFit) -> Model:
        """A fitted model with its standard errors."""
        return fitted_model(self.settled(fit))

    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """The verdict when no effect is named, by the unexplained part of the drive's force."""
        fit = self.parent
        if self.residual_curve is not None:
            return UNKNOWN, ()
        worst = int(np.argmax(fit.relative_by_body))
        if fit.relative_by_body[worst] < ADEQUATE_FORCE or not fit.model_error_dominates:
            return ADEQUATE, ()
        force = "drive force" if worst == 0 else f"force on {fit.model.bodies[worst]}"
        text = (
            f"{100.0 * fit.relative_by_body[worst]:.3g} % of the {force} stays unexplained, which sensor noise does not"
            " account for: no effect that was looked for explains more of it on samples that the fit has not seen"
        )
        return UNKNOWN, (text,)


def fitted_model(fit: WeakFit) -> Model:
    """The model with its fitted values and their standard errors."""
    return fit.model.with_values({}, standard_errors(fit.model, fit.covariance))


class ForceView(View[WeakFit]):
    """Evaluates effects by the force balance, on held-out records as well; new windows are added to `forms`."""

    def __init__(
        self,
        estimation: EstimationProblem,
        options: Options,
        held_out: Sequence[Data] = (),
        forms: dict[int, WeakForm] | None = None,
    ) -> None:
        self.estimation, self.options = estimation, options
        self.held_out, self._forms = tuple(held_out), {} if forms is None else forms

    def evaluate(self, parent: WeakFit) -> SearchStep[WeakFit]:
        """Weigh every effect of the catalogue, and pairs of them where none shows alone."""
        whole, parent, options = parent, parent.subsampled(ENOUGH), self.options
        model, coarse = parent.model, parent.subsampled(_COARSE_WINDOWS)
        screen = _Screen(self.estimation, parent, coarse)
        # Beside the values of these windows: a trace is the change by the effect alone.
        proposed = proposals(coarse.model, options.effects, self.estimation.conditions)
        choices = [one for one in proposed if _balances(one)]
        screened = list(in_parallel(screen, choices))
        promising = [found for found in screened if found.starts]
        # What the free parameters can do as well promises anything, and comes last.
        promising.sort(key=lambda found: (found.own_part < OWN_PART, -found.promise))
        worth = _WORTH_A_FIT * promising[0].promise if promising else 0.0
        chosen = promising[:_FEWEST_FITS] + [
            found for found in promising[_FEWEST_FITS:_MOST_FITS] if found.promise >= worth
        ]
        parts = {part for found in chosen for part in found.proposal.effect.contains}
        chosen += [found for found in promising if found.proposal.effect.name in parts and found not in chosen]
        evaluator = _Evaluator(self.estimation, parent, coarse, self.held_out)
        apart = [one for found in chosen for one in found.apart()]
        evaluated = _surest(evaluator(in_parallel(partial(_fitted, coarse), apart), options.level))
        step = ForceStep(
            whole, tuple(evaluated), len(choices) + screen.waves, options.level, options.minimum_improvement,
            tuple(proposed), subsampled=parent,
        )  # fmt: skip
        design = min((one.evidence.design_effect for one in evaluated), default=1.0)
        step = replace(step, undetermined=_undetermined(step))
        testable, why = _testable(proposed, screened, design * step.threshold())
        curves = force_curves(parent, evaluator.base)
        beside = _beside(curves, evaluated)
        step = replace(step, rejected=_within_rounding(step, self.estimation.records))
        pairs = [] if beside else evaluator(in_parallel(partial(_pair, coarse), _pairs(step)), options.level)
        return replace(
            step,
            evaluated=(*evaluated, *pairs),
            gate=Gate(excitation_findings(model, self.estimation), testable, why),
            residual_curves=tuple(curves),
            beside=tuple(beside),
        )

    def best_fit(self, parent: WeakFit) -> WeakFit | None:
        """The model with the first effect that can be fitted, from where its trace promises most; else None."""
        screen = _Screen(self.estimation, parent, parent)
        for proposal in proposals(parent.model, self.options.effects, self.estimation.conditions):
            fitted = _fitted(parent, screen(proposal)) if _balances(proposal) else None
            if fitted is not None:
                return fitted[1]
        return None

    def refit_thoroughly(self, fit: WeakFit) -> WeakFit:
        """The same model in windows as wide as its noise requires: the less it leaves, the wider they are."""
        form = fit.form
        found = fit_by_force(
            form.engine, self.estimation.data, fit.theta, self._forms, accept_noise=True, rest_speed=form.rest_speed,
            narrowest=form.width,
        )  # fmt: skip
        return found or fit

    def refitted(self, model: Model, fit: WeakFit) -> Model | None:
        """As in `View`, in the windows of the fit."""
        found = fit_in(fit.form, model, fit.shift, TOLERANCE)
        return None if found is None else fitted_model(found)

    def without(self, fit: WeakFit, name: str) -> WeakFit | None:
        """The model without one of its effects, where its evidence is no less; else None.

        Or where it is no less with the simpler effect that this one contains, which is then evaluated again.
        """
        fit = fit.subsampled(ENOUGH)
        active = next(one for one in fit.model.effects if one.name == name)
        model, values = fit.model.without_effect(name), values_of(active, fit.model.values)
        simpler = [
            model.with_effect(simple, active.at, **{theirs: values[own] for theirs, own in shared.items()})
            for simple, shared in active.effect.contains.items()
            if f"{simple}@{active.at}" not in model.effect_names
        ]
        smaller, *others = (fit_in(fit.form, one, fit.shift) for one in (model, *simpler))
        if smaller is None or not any(self._equals(one, fit) for one in (smaller, *others) if one is not None):
            return None
        return self.refit_thoroughly(smaller)

    def _equals(self, other: WeakFit, fit: WeakFit) -> bool:
        """Whether a model fitted to the same windows has no less evidence."""
        try:
            evidence = scores_of(fit).against(scores_of(other))
        except (IdloopError, np.linalg.LinAlgError):
            return False
        level, least = self.options.level, self.options.minimum_improvement
        return _improvement(evidence, other, fit) < least or evidence.log < math.log(1.0 / level)


def _improvement(evidence: Evidence, before: WeakFit, after: WeakFit) -> float:
    """Part by which errors fall: the smaller one of that on unseen samples and that of the force error."""
    return min(evidence.improvement, 1.0 - math.exp(-_fall(before, after)))


def _fall(before: WeakFit, after: WeakFit) -> float:
    """Mean logarithm by which the relative force errors of the bodies fall."""
    return _log_mean(before.relative_by_body) - _log_mean(after.relative_by_body)


def _surest(evaluated: Iterable[EvaluatedModel[WeakFit]]) -> list[EvaluatedModel[WeakFit]]:
    """Of models with the same effects, such as with another harmonic, the one with the most evidence."""
    found: dict[tuple[str, ...], EvaluatedModel[WeakFit]] = {}
    for one in evaluated:
        if one.names not in found or one.evidence.log > found[one.names].evidence.log:
            found[one.names] = one
    return list(found.values())


def _undetermined(step: ForceStep) -> dict[str, str]:
    """Significant effects that the data do not determine, or beside which they do not determine others, and why."""
    parent, found = fitted_model(step.subsampled), {}
    determined = False
    for one in step.significant:
        fit: WeakFit | None = one.fit
        if len(one.proposals) > 1 or fit is None:
            continue
        if not fit.jacobian.size:
            # Far behind the best, it keeps its values: it is fitted where it may be named.
            fit = None if determined else _refitted(fit, step.subsampled.form)
        if fit is None:
            continue
        if why := undetermined_with(parent, fitted_model(fit), one.proposals[0]):
            found[one.names[0]] = why
        else:
            determined = True
    return found


def _within_rounding(step: ForceStep, records: Sequence[Record]) -> dict[str, str]:
    """Effects that explain no more than readings of a position which are half a quantum off."""
    parent = step.subsampled
    # The rounding matters where an effect would be named.
    forms = readings_half_a_quantum_off(parent, records) if step.tied else []
    fits = [fit for form in forms if (fit := fit_in(form, parent.model, parent.shift)) is not None]
    rejected = {}
    for scores in map(scores_of, fits):
        for one in step.significant:
            beyond = one.scores.against(scores)
            if not step.conclusive(beyond) or beyond.improvement < step.minimum_improvement:
                rejected[one.names[-1]] = READINGS_OFF
    return rejected


def _pairs(step: SearchStep[WeakFit]) -> list[tuple[EvaluatedModel[WeakFit], EvaluatedModel[WeakFit]]]:
    """Which of the effects that were fitted alone are tried together.

    The best few, where none is significant alone. Else, where the best contains a simpler one, that one with each of
    the others: two simple effects may have the same equation.
    """
    singles = list(step.evaluated)
    if not step.tied:
        best = sorted(singles, key=lambda one: -one.gain)[:_FEWEST_FITS]
        return [(a, b) for place, a in enumerate(best) for b in best[place + 1 :]]
    if step.tied[0].proposals[0].replaces is not None:
        return []
    simple = [one for one in singles if step.tied[0].contains(one)]
    others = [one for one in singles if not one.proposals[0].effect.contains]
    return [(a, b) for a in simple for b in others if b is not a and b.proposals[0].replaces is None]


def _beside(
    curves: Sequence[ForceCurve], evaluated: Sequence[EvaluatedModel[WeakFit]]
) -> list[EvaluatedModel[WeakFit]]:
    """Effects beside a curve over the position that explains far more than any of them: they may be confounded."""
    if not curves or not evaluated or not curves[0].may_confound:
        return []
    curve, best = curves[0], max(evaluated, key=lambda one: one.evidence.difference)
    far_more = curve.evidence.difference >= CONFOUNDING_RATIO * best.evidence.difference
    if not far_more or not curve.scores.against(best.scores).distinguishable:
        return []
    return [curve.beside(one) for one in evaluated]


def _balances(proposal: Proposal) -> bool:
    """Whether a force balance along the measured motion contains an effect."""
    return proposal.effect.site != OUTPUT and not proposal.effect.splits


def unbalanced(model: Model, effects: Sequence[str] | None, conditions: Mapping[str, str]) -> list[str]:
    """Names of the effects that could be added to a model and that its force balance does not show."""
    return [
        one.name
        for one in proposals(model, effects, conditions)
        if not _balances(one)
        # A force balance estimates the time at which commands act, and shows little of their quick changes.
        or (one.effect.site == INPUT and one.effect.lags)
    ]


@dataclass(frozen=True)
class _Promising:
    """What the trace of an effect promises, and from where its fit begins."""

    proposal: Proposal
    promise: float  # log-likelihood
    typical: float  # log-likelihood that the effect would be worth at its typical size
    own_part: float  # of its trace, which the free parameters cannot produce
    starts: list[Trial]
    tried: bool = True  # at any values

    def apart(self) -> list[_Promising]:
        """One for each choice of the whole numbers, such as a harmonic, which a fit does not change."""
        whole = self.proposal.whole_numbers
        groups: dict[tuple[float, ...], list[Trial]] = {}
        for start in self.starts:
            groups.setdefault(tuple(start[name] for name in whole), []).append(start)
        return [replace(self, starts=group) for group in groups.values()]


class _Screen:
    """Correlates the traces that effects would leave in a force balance with what it leaves unexplained.

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
        left, weight, _ = np.linalg.svd(slopes / np.where(norms > 0.0, norms, 1.0), full_matrices=False)
        known = weight > 1e-6 * np.max(weight, initial=0.0)
        self.basis = left[:, known]
        self.errors = self.errors - self.basis @ (self.basis.T @ self.errors)
        found = {body: harmonics(whole, index) for index, body in enumerate(model.bodies)}
        self._harmonics = {body: several for body, (several, _) in found.items()}
        # Along an angle no candidate has a period of its own.
        lengths = [] if model.units.position == "rad" else model.bodies
        repeated = {body: unexplained_period(whole, i) for i, body in enumerate(lengths)}
        self._periods = {body: one for body, one in repeated.items() if one is not None}
        self.waves = sum(tried for _, tried in (*found.values(), *self._periods.values()))

    def __call__(self, proposal: Proposal) -> _Promising:
        """What an effect promises; without starts where it promises nothing."""
        scales = self.sizes.at(proposal.effect.site, proposal.at)
        periods = self._periods.get(proposal.at, ())[:1]
        scales = replace(scales, harmonics=self._harmonics.get(proposal.at, ()), periods=periods)
        found, typical, part = [], 0.0, 0.0
        alternatives = proposal.alternatives(scales)
        for trials in alternatives:
            columns = [self._trace(proposal, trial) for trial in trials]
            if any(column is None for column in columns):
                continue
            raw = np.stack([column for column in columns if column is not None]).T
            own = raw - self.basis @ (self.basis.T @ raw)
            powers = np.sum(own**2, axis=0)
            typical = max(typical, 0.5 * float(np.max(powers)) / self._share)
            part = max(part, float(np.max(powers / np.maximum(np.sum(raw**2, axis=0), 1e-300))))
            size, *_ = np.linalg.lstsq(own, -self.errors, rcond=1e-6)
            if len(trials) == 1 and proposal.one_sided:
                size = np.maximum(size, 0.0)
            promise = self._gain(self.errors + own @ size)
            if np.isfinite(promise):
                first = promise
                if len(trials) == 1 and proposal.weaker(trials[0], 0.5) == trials[0]:
                    # An effect without a strength, such as a limit, begins as it was tried: beside a command that it
                    # cuts off, inertia and gain are others.
                    first = self._first_gain(proposal.model(trials[0]))
                found.append((first, promise, trials, size))
        most = max((promise for _, promise, *_ in found), default=0.0)
        if most < LEAST_GAIN:
            return _Promising(proposal, 0.0, typical, part, [], bool(alternatives))
        found.sort(key=lambda one: -one[0])
        several = _WHOLE_NUMBERS if proposal.whole_numbers else _STARTS
        starts = [start for *_, trials, size in found[:several] for start in _starts(proposal, trials, size)]
        return _Promising(proposal, most, typical, part, starts)

    def _gain(self, left: Array) -> float:
        """Log-likelihood gained where these errors are left."""
        return 0.5 * float(self.errors @ self.errors - left @ left) / self._share

    def _first_gain(self, model: Model) -> float:
        """Log-likelihood gained by one round of a fit; minus infinity where it loses the inertia."""
        fit = fit_in(self.parent.form, model, self.parent.shift, rounds=1)
        if fit is None or _loses_inertia(fit, self.parent):
            return -math.inf
        return (fit.log_likelihood - self.parent.log_likelihood) / self._share

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
    proposed: Sequence[Proposal], screened: Sequence[_Promising], threshold: float
) -> tuple[dict[str, str], dict[str, str]]:
    """Whether the force balance can show each effect, and why: sensors and split bodies are not part of it."""
    testable, why = {}, {}
    for one in screened:
        name = one.proposal.name
        if not one.tried:
            testable[name], why[name] = "no", NOT_REPEATED
        elif one.own_part < OWN_PART:
            testable[name], why[name] = "no", "on this data the free parameters can do the same"
        elif one.typical < threshold:
            testable[name], why[name] = "no", "at its typical size it explains too little force to show"
        else:
            testable[name] = "weak" if one.proposal.effect.from_a_level else "yes"
            why[name] = f"at its typical size it would gain {one.typical:.3g} units of log-likelihood"
    for proposal in proposed:
        if not _balances(proposal):
            testable[proposal.name] = "no"
            why[proposal.name] = "a force balance along the measured motion does not contain it"
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
    """Cost of a model in the windows of another one, not fitted."""
    form = form.with_engine(CachingEngine(model))
    return cost_at(form, np.append(model.theta, shift) if form.free_timing else model.theta)


def _fitted(parent: WeakFit, promising: _Promising) -> _Fitted | None:
    """The model with an effect, fitted in the windows of its parent."""
    form, shift = parent.form, parent.shift
    models = [promising.proposal.model(trial) for trial in promising.starts]
    models.sort(key=partial(_cost_in, form, shift))
    fits = [fit_in(form, model, shift, rounds=_FIRST_ROUNDS) for model in models[:_STARTS]]
    best = max((fit for fit in fits if fit is not None), key=lambda fit: fit.log_likelihood, default=None)
    if best is None:
        return None
    if not best.converged:
        best = _refitted(best, form) or best
    return (promising.proposal,), with_rest_speed(best, RANKING_TOLERANCE)


def _refitted(fit: WeakFit, form: WeakForm, tolerance: float = RANKING_TOLERANCE) -> WeakFit | None:
    """The model of a fit, fitted on from there in other windows."""
    return fit_in(form.with_rest_speed(fit.form.rest_speed), fit.model, fit.shift, tolerance)


class _Evaluator:
    """Evaluates fitted models against one without their effects: all in few windows, the best in all windows."""

    def __init__(
        self, estimation: EstimationProblem, parent: WeakFit, coarse: WeakFit, held_out: Sequence[Data]
    ) -> None:
        self.estimation, self.parent, self.base = estimation, parent, scores_of(parent)
        self.coarse = coarse
        form = weak_form(parent.form.engine, held_out, parent.form.width) if held_out else None
        self._held_out = None if form is None else form.subsampled(ENOUGH)
        self._before = self._typical_error(parent)
        self._resolved = estimation.resolves(parent.model)

    def _typical_error(self, fit: WeakFit) -> float:
        """Logarithm of the typical error on the held-out records, whose scale is their own."""
        if self._held_out is None:
            return 0.0
        return -float(np.mean(fit.along(_along(self._held_out, fit)).log_densities()))

    def __call__(self, fits: Iterable[_Fitted | None], level: float) -> list[EvaluatedModel[WeakFit]]:
        """Those of models fitted in few windows that explain anything, with their evidence."""
        fitted = [one for one in fits if one is not None]
        if self.coarse is self.parent:
            return self._all((*one, scores_of) for one in fitted)
        seen = [(chosen, fit, _scores_or_none(fit, scores_of)) for chosen, fit in fitted]
        known = [scores for *_, scores in seen if scores is not None]
        best = max(known, key=lambda scores: float(np.sum(scores.log_density)), default=None)

        def on(one: tuple[tuple[Proposal, ...], WeakFit, Scores | None]) -> _Scored | None:
            chosen, fit, scores = one
            if scores is None or best is None:
                return None
            ahead = best.against(scores)
            if ahead.distinguishable and ahead.log > math.log(1.0 / level):
                # Far behind the best: it keeps its values, which most of the other windows had no part in.
                return chosen, fit.along(_along(self.parent.form, fit)), scores_without_refit
            further = _refitted(fit, self.parent.form)
            return None if further is None else (chosen, further, scores_of)

        return self._all(one for one in in_parallel(on, seen) if one is not None)

    def _all(self, scored: Iterable[_Scored]) -> list[EvaluatedModel[WeakFit]]:
        return [one for one in in_parallel(self._evaluate, list(scored)) if one is not None]

    def _evaluate(self, scored: _Scored) -> EvaluatedModel[WeakFit] | None:
        chosen, fit, scored_by = scored
        gain = fit.log_likelihood - self.parent.log_likelihood
        if gain < LEAST_GAIN or _loses_inertia(fit, self.parent):
            return None
        if self._resolved and not self.estimation.resolves(fit.model):
            return None
        scores = _scores_or_none(fit, scored_by)
        if scores is None:
            return None
        held_out, as_fitted = None, False
        try:
            after = self._typical_error(fit)
        except (IdloopError, np.linalg.LinAlgError):
            return None
        evidence = scores.against(self.base)
        if self._can_improve(chosen, fit) >= _CARRIES_OVER * evidence.improvement:
            # An error that has grown by a factor of e⁵⁰ has diverged.
            held_out = 1.0 - math.exp(min(after - self._before, 50.0))
            as_fitted = self._as_fitted(fit, after)
        return EvaluatedModel(chosen, fit, scores, evidence, gain, held_out, as_fitted)

    def _as_fitted(self, fit: WeakFit, held_out: float) -> bool:
        """Whether errors on the held-out records are no larger than on the worst fitted one, and have hardly grown.

        `held_out` is the logarithm of their typical error. It may grow by a part of what the fitted records gain.
        """
        density, before = -fit.log_densities(), -self.parent.log_densities()
        starts = fit.form.starts
        worst = max(float(np.mean(density[first:last])) for first, last in pairwise(starts))
        gained = math.exp(float(np.mean(before))) - math.exp(float(np.mean(density)))
        grown = math.exp(min(held_out, 50.0)) - math.exp(self._before)
        return held_out <= worst and grown <= _LITTLE_HARM * gained

    def _can_improve(self, chosen: tuple[Proposal, ...], fit: WeakFit) -> float:
        """Part by which effects reduce the errors on the held-out records if they are true: a limit may not be reached.

        NaN without such records.
        """
        if self._held_out is None:
            return math.nan
        form = _along(self._held_out, fit)
        # The second of a pair may have replaced the first.
        there = [proposal.name for proposal in chosen if proposal.name in fit.model.effect_names]
        model = fit.model.without_effects(there)
        without = form.with_engine(CachingEngine(model))
        left, other = form.residual(fit.theta, fit.shift), without.residual(model.theta, fit.shift)
        size = float(np.linalg.norm(left))
        return 1.0 - size / max(math.hypot(size, float(np.linalg.norm(other - left))), 1e-300)


def _inertia(fit: WeakFit) -> float:
    """Inertia of the driven body over the drive's gain: the common scale of both may be unknown."""
    return float(fit.form.inertia(fit.theta)[0]) / fit.form.gain(fit.theta)


def _loses_inertia(fit: WeakFit, parent: WeakFit) -> bool:
    """Whether an effect explains the force in place of the inertia: nothing would be left to move."""
    return _inertia(fit) < _LEAST_INERTIA * _inertia(parent)


def _along(form: WeakForm, fit: WeakFit) -> WeakForm:
    """Windows with the model and the rest speed of a fit."""
    return form.with_engine(fit.form.engine).with_rest_speed(fit.form.rest_speed)


def _log_mean(relatives: Array) -> float:
    """Mean logarithm of the relative force error of the bodies."""
    return float(np.mean(np.log(np.maximum(relatives, 1e-300))))


def _scores_or_none(fit: WeakFit, scored_by: Callable[[WeakFit], Scores]) -> Scores | None:
    try:
        scores = scored_by(fit)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return scores if np.all(np.isfinite(scores.log_density)) else None


def _pair(parent: WeakFit, pair: tuple[EvaluatedModel[WeakFit], EvaluatedModel[WeakFit]]) -> _Fitted | None:
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
