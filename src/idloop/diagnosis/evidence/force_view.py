"""One step of a diagnosis by the force balance: effects that explain force on samples that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.force_evaluation import (
    CARRIES_OVER,
    Evaluator,
    fit_again,
    fit_pair,
    fit_promising,
    log_mean,
)
from idloop.diagnosis.evidence.predictive import Evidence, scores_of
from idloop.diagnosis.evidence.quantisation import READINGS_OFF, readings_half_a_quantum_off
from idloop.diagnosis.evidence.undetermined_strength import undetermined_with
from idloop.diagnosis.identifiability import OWN_PART, Gate, excitation_findings
from idloop.diagnosis.options import FORCE, Options
from idloop.diagnosis.residual_curves.force_curves import ForceCurve, force_curves
from idloop.diagnosis.screening.force_screen import ForceScreen, acts_in_balance, fit_in, testable_by_force
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search.step import ADEQUATE, CONFOUNDING_RATIO, UNKNOWN, EvaluatedModel, SearchStep, View
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_fit import LEAST_UNEXPLAINED, TOLERANCE, WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.likelihood.estimation_problem import ENOUGH, EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.statistics.undetermined import standard_errors
from idloop.physics.effect import INPUT
from idloop.physics.model import Model, values_of
from idloop.records import Record

Array = NDArray[np.float64]

# Effects that are fitted, by what their traces promise: four always (and in pairs), others with a fiftieth of the best.
_MOST_FITS, _FEWEST_FITS, _WORTH_A_FIT = 10, 4, 0.02
# Two effects that show only together reduce the error by half: any two reduce it a little.
_TOGETHER = 0.5
# Windows in which all effects are fitted first; the best are fitted again in all windows.
_COARSE_WINDOWS = 2_000
# A model that leaves less than this part of the drive's force is adequate where no effect explains more.
ADEQUATE_FORCE = 0.1
# Where no held-out record shows it, an effect explains at least this part of the power of errors beyond sensor noise:
# beside a force that no effect describes, one that follows a corner of it shows as well.
_LEAST_PART = 0.05


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
        """Whether it reduces errors enough, on held-out records as well, and the balance is exact enough to show it."""
        return (
            self._unexplained >= LEAST_UNEXPLAINED and super().practically_significant(one) and self._carries_over(one)
        )

    @property
    def _unexplained(self) -> float:
        """Largest part of a body's force that is unexplained before."""
        return float(np.max(self.subsampled.relative_by_body))

    def _part(self, one: EvaluatedModel[WeakFit]) -> float:
        """Part of the power of the errors of all bodies that it explains, of those that no noise accounts for."""
        noise = self.subsampled.noise_share
        left = max(1.0 - one.evidence.improvement, math.exp(-len(noise) * _fall(self.subsampled, one.fit)))
        return (1.0 - left**2) / max(1.0 - float(np.max(noise)) ** 2, 1e-300)

    def _carries_over(self, one: EvaluatedModel[WeakFit]) -> bool:
        """Whether the held-out records have smaller errors as well, or errors like those of the fitted ones.

        One record whose errors happened to be small says little beside many that an effect explains. Without held-out
        records, of an effect that they do not reach, and where they do not show it, the fitted ones must show enough.
        """
        least = max(CARRIES_OVER * self.improvement(one), self.minimum_improvement)
        if one.held_out is not None and one.held_out >= least:
            return True
        return (one.held_out is None or one.as_fitted) and self._part(one) >= _LEAST_PART

    def _nearly_degenerates_to(self, rich: EvaluatedModel[WeakFit], plain: EvaluatedModel[WeakFit]) -> bool:
        """As in `SearchStep`, or what it explains beyond the other one does not carry over to the held-out records."""
        if super()._nearly_degenerates_to(rich, plain):
            return True
        if not rich.degenerates_to(plain) or rich.held_out is None or plain.held_out is None:
            return False
        beyond = 1.0 - (1.0 - rich.held_out) / (1.0 - plain.held_out)
        return beyond < CARRIES_OVER * rich.scores.against(plain.scores).improvement

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
        if self._unexplained < LEAST_UNEXPLAINED:
            return (
                f"only {100.0 * self._unexplained:.2g} % of the force is unexplained: below"
                f" {100.0 * LEAST_UNEXPLAINED:g} % errors of the balance itself, at reversals, look like effects"
            )
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
        return (fit_again(fit, self.parent.form, TOLERANCE) or fit) if ranked else fit

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

    def within(self, begin: float, end: float) -> ForceView:
        """As in `View`."""
        return ForceView(self.estimation, self.options.within(begin, end), self.held_out, self._forms)

    def evaluate(self, parent: WeakFit) -> SearchStep[WeakFit]:
        """Weigh every effect of the catalogue, and pairs of them where none shows alone."""
        whole, parent, options = parent, parent.subsampled(ENOUGH), self.options
        model, coarse = parent.model, parent.subsampled(_COARSE_WINDOWS)
        screen = ForceScreen(self.estimation, parent, coarse)
        # Beside the values of these windows: a trace is the change by the effect alone.
        proposed = proposals(coarse.model, options.effects, self.estimation.conditions, screen.periods)
        choices = [one for one in proposed if acts_in_balance(one)]
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
        evaluator = Evaluator(self.estimation, parent, coarse, self.held_out)
        apart = [one for found in chosen for one in found.apart()]
        evaluated = _surest(evaluator(in_parallel(partial(fit_promising, coarse), apart), options.level))
        step = ForceStep(
            whole, tuple(evaluated), len(choices) + screen.waves, options.level, options.minimum_improvement,
            tuple(proposed), subsampled=parent,
        )  # fmt: skip
        design = min((one.evidence.design_effect for one in evaluated), default=1.0)
        step = replace(step, undetermined=_undetermined(step))
        testable, why = testable_by_force(proposed, screened, design * step.threshold())
        curves = force_curves(parent, evaluator.base)
        beside = _beside(curves, evaluated)
        step = replace(step, rejected=_within_rounding(step, self.estimation.records))
        pairs = [] if beside else evaluator(in_parallel(partial(fit_pair, coarse), _pairs(step)), options.level)
        return replace(
            step,
            evaluated=(*evaluated, *pairs),
            gate=Gate(excitation_findings(model, self.estimation), testable, why),
            residual_curves=tuple(curves),
            beside=tuple(beside),
        )

    def best_fit(self, parent: WeakFit) -> WeakFit | None:
        """The model with the first effect that can be fitted, from where its trace promises most; else None."""
        screen = ForceScreen(self.estimation, parent, parent)
        for proposal in proposals(parent.model, self.options.effects, self.estimation.conditions):
            fitted = fit_promising(parent, screen(proposal)) if acts_in_balance(proposal) else None
            if fitted is not None:
                return fitted[1]
        return None

    def leaves_model_error(self, fit: WeakFit) -> bool:
        """As in `View`."""
        return fit.usable and float(np.max(fit.relative_by_body)) >= ADEQUATE_FORCE

    def exchanged(self, fit: WeakFit, name: str, other: str) -> WeakFit | None:
        """As in `View`."""
        without = fit.model.without_effect(name)
        offered = proposals(without, [other], self.estimation.conditions)
        found = fit_in(fit.form, offered[0].model({}), fit.shift) if offered else None
        as_likely = found is not None and found.log_likelihood >= fit.log_likelihood - math.log(
            1.0 / self.options.level
        )
        return found if as_likely else None

    def reported(self, fit: WeakFit) -> Model:
        """As in `View`."""
        return fitted_model(fit)

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
    return log_mean(before.relative_by_body) - log_mean(after.relative_by_body)


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
            fit = None if determined else fit_again(fit, step.subsampled.form)
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


def unbalanced(model: Model, effects: Sequence[str] | None, conditions: Mapping[str, str]) -> list[str]:
    """Names of the effects that could be added to a model and that its force balance does not show."""
    return [
        one.name
        for one in proposals(model, effects, conditions)
        if not acts_in_balance(one)
        # A force balance estimates the time at which commands act, and shows little of their quick changes.
        or (one.effect.site == INPUT and one.effect.lags)
    ]
