"""One step of a diagnosis by one-step or free-run errors: effects that explain errors on unseen samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.diagnosis import candidate_of
from idloop.diagnosis.equivalence.same_motion import same_motion, same_motion_from_another_place, within_quantisation
from idloop.diagnosis.evidence.force_view import unbalanced
from idloop.diagnosis.evidence.predictive import Scores
from idloop.diagnosis.evidence.quantisation import READINGS_OFF, WITHIN_QUANTUM
from idloop.diagnosis.evidence.undetermined_strength import is_none, undetermined_with
from idloop.diagnosis.identifiability import gate
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.options import PREDICTION, Options, Progress
from idloop.diagnosis.residual_curves.prediction_curves import PredictionCurve, fitted_curves
from idloop.diagnosis.screening.command_response import CommandResponse, missing_response, responds_to_command
from idloop.diagnosis.screening.innovation_scores import InnovationScores
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screen, Screened
from idloop.diagnosis.search.confirm import (
    STILL_IN_IT,
    Confirmed,
    confirm,
    points,
    promising,
    refit_under_restricted_noise,
)
from idloop.diagnosis.search.non_local_search import candidates_beside, non_local_searches, whitened
from idloop.diagnosis.search.pairs import confirmed_pairs
from idloop.diagnosis.search.step import ADEQUATE, LEAST_GAIN, NOT_EXCITED, UNKNOWN, EvaluatedModel, SearchStep, View
from idloop.errors import IdloopError
from idloop.estimation.likelihood.disturbance import LONG_MEMORY
from idloop.estimation.likelihood.estimation_problem import ENOUGH, FEW, EstimationProblem
from idloop.estimation.likelihood.likelihood_difference import beyond_chance, distinguishable
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import MANY_LAGS, Refit, refit, refit_or_none, transfer
from idloop.estimation.likelihood.restarts import has_contacts, search_repeatedly
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.statistics.whitening import choose_order
from idloop.physics.effect import INPUT, OUTPUT
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.measures import NEGLIGIBLE

# Below this part of the deviation the error of a free run counts as this: another integration method changes it.
_LEAST_FREE_RUN_ERROR = 0.01
# Accuracy of the shift of a command, first shift that is tried [samples], and rounds of the search at each.
_SHIFT_STEP, _FIRST_SHIFT, _SHIFT_ROUNDS = 0.001, 0.003, 2
# An earlier command explains what an effect explains where it gains at least this part of its log-likelihood.
_COMPARABLE = 0.5
# A first look at a few samples is worth its time where there are so many times as many.
_WORTH_A_LOOK = 2
# Effects, one or two, and the model that has them fitted.
_Fitted = tuple[tuple[Proposal, ...], Refit]


@dataclass(frozen=True)
class PredictionStep(SearchStep[Refit]):
    """The models that one step has evaluated by one-step or free-run errors."""

    estimation: EstimationProblem = field(kw_only=True)  # what was fitted
    unseen: tuple[Record, ...] = field(kw_only=True)  # their free run decides on practical significance
    whole: EstimationProblem | None = None  # all samples, where effects were evaluated in some of them only
    response: CommandResponse = CommandResponse.FOLLOWS  # of the motion to the command
    # Computed so far, by the identity of the fit: its improvement, and whether it holds on the held-out records.
    improvements: dict[int, tuple[Refit, float]] = field(default_factory=dict, compare=False)
    held: dict[int, tuple[Refit, bool]] = field(default_factory=dict, compare=False)

    @property
    def criterion(self) -> str:
        """What the models are measured by."""
        return self.estimation.kind

    def improvement(self, one: EvaluatedModel[Refit]) -> float:
        """Part by which an effect reduces errors: those one sample ahead, or those of the free run."""
        if id(one.fit) not in self.improvements:
            part = one.evidence.improvement
            splits = any(proposal.effect.splits for proposal in one.proposals)
            if not splits and same_motion(one.fit.model, self.parent.model, self.estimation.records):
                part = 0.0
            elif not part >= self.minimum_improvement:
                part = max(part, self._of_the_free_run(one.fit.model))
            self.improvements[id(one.fit)] = one.fit, part
        return self.improvements[id(one.fit)][1]

    @cached_property
    def _before(self) -> dict[str, Any]:
        """Errors of the free run without any of the effects."""
        return model_errors(self.parent.model, self.unseen)

    def _of_the_free_run(self, model: Model) -> float:
        before, after = self._before, model_errors(model, self.unseen)
        parts = [0.0]
        for label in ("nrmse", "anew"):
            was = np.array(list(before[label].values()))
            now = np.array([after[label].get(name, np.inf) for name in before[label]])
            least = _LEAST_FREE_RUN_ERROR * math.sqrt(len(was))
            parts.append(float((np.linalg.norm(was) - np.linalg.norm(now)) / max(np.linalg.norm(was), least)))
        return max(parts)

    def _equal(self, best: EvaluatedModel[Refit], other: EvaluatedModel[Refit]) -> bool:
        # The noise is modelled: a difference counts as it is.
        against = best.scores.against(other.scores)
        return against.difference + against.start <= math.log(1.0 / self.level)

    @property
    def decided(self) -> bool:
        """Whether more samples would name the same effect: one alone, with twice the evidence that is asked for."""
        if len(self.tied) != 1:
            return False
        (best,) = self.tied
        return len(best.proposals) == 1 and best.evidence.log >= 2.0 * self.threshold()

    def jointly_needed(self, pair: EvaluatedModel[Refit]) -> bool:
        """Whether each of two effects is needed beside the other."""
        alone = [one for one in self.evaluated if len(one.names) == 1 and one.names[0] in pair.names]
        beyond = [pair.scores.against(one.scores) for one in alone]
        if len({one.names[0] for one in alone}) < len(pair.names):
            beyond.append(pair.evidence)
        return all(map(self.conclusive, beyond))

    def insignificance(self, one: EvaluatedModel[Refit]) -> str:
        """Why a significant effect has no practical significance."""
        part = max(self.improvement(one), 0.0)
        if part == 0.0:
            return f"it moves no output by more than {100.0 * NEGLIGIBLE:g} % of its standard deviation"
        return (
            f"it reduces the errors on unseen samples by {100.0 * part:.3g} % only, and "
            f"{100.0 * self.minimum_improvement:g} % is asked for"
        )

    def _settled(self, fit: Refit) -> Refit:
        """A model that was evaluated in some samples is fitted to all."""
        if self.whole is None or all(fit is not one.fit for one in self.evaluated):
            return fit
        return refit_or_none(self.whole, fit.model, None, self.parent) or fit

    def reported(self, fit: Refit) -> Model:
        """A fitted model with its standard errors."""
        return self.settled(fit).with_stderr()

    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """The verdict when no effect is named."""
        responds = self.response is CommandResponse.FOLLOWS
        findings = () if responds else (self.response.text,)
        if self.residual_curve is not None or self.response is CommandResponse.OTHERWISE:
            return UNKNOWN, findings
        return (NOT_EXCITED if self.gate.poor or not responds else ADEQUATE), findings


@dataclass(frozen=True)
class PredictionView(View[Refit]):
    """Evaluates effects by one-step errors, or those of the free run; on held-out records they must do no harm.

    `balanced`: what the force balance of the model at the start has evaluated is not evaluated again. `follows`: the
    balance shows that the motion follows the command, whatever the noise model has absorbed.
    """

    estimation: EstimationProblem
    start: Model  # as the user gave it
    options: Options
    held_out: EstimationProblem | None = None
    balanced: bool = False
    follows: bool = False
    timed: bool = False  # whether the stamps of the command are corrected
    promised: float = 0.0  # part of the power of the errors that an effect's trace must promise for it to be fitted
    support: EstimationProblem | None = None  # in which an effect that is named must gain likelihood as well

    def beside(self, model: Model, *, balanced: bool) -> PredictionView:
        """The same view from a model on that a force balance has found; `balanced` as of the class."""
        return replace(self, start=model, balanced=balanced, follows=True)

    def within(self, begin: float, end: float) -> PredictionView:
        """As in `View`."""
        return replace(self, options=self.options.within(begin, end))

    def balances(self, model: Model) -> bool:
        """Whether a force balance has decided; once a body is split, that along its measured motion is void."""
        return self.balanced and not model.inner_couplings

    def choices(self, model: Model) -> Sequence[str] | None:
        """Effects to choose from beside a model; None for the whole catalogue."""
        effects = self.options.effects
        return unbalanced(model, effects, self.estimation.conditions) if self.balances(model) else effects

    def evaluate(self, parent: Refit) -> SearchStep[Refit]:
        """Evaluate the effects of the catalogue that a score test finds promising, and pairs of them.

        A few samples decide on most effects: more are used only where these do not. What would be named beside a force
        balance must be the best of all that look like it: these may act in less time than a window of that.
        """
        step = None
        if sum(len(one.time) for one in self.estimation.data) >= _WORTH_A_LOOK * FEW:
            step = PredictionView._evaluate_in(self.within(0.0, 0.4), FEW, parent, first_look=True)
        if step is None or self._leaves_open(step):
            step = PredictionView._evaluate_in(self.within(0.4, 0.8), ENOUGH, parent)
        if not step.tied or not self.balances(parent.model):
            return step
        alike = [one for one in proposals(parent.model, self.options.effects, self.estimation.conditions)
                 if any(_look_alike(one, tied) for best in step.tied for tied in best.proposals)]  # fmt: skip
        if {one.name for one in alike} <= {one.name for one in step.proposed}:
            return step
        options = replace(self.options.within(0.8, 1.0), effects=[one.name for one in alike])
        among_alike = replace(self, balanced=False, options=options).evaluate(parent)
        return among_alike if among_alike.tied else step

    def _leaves_open(self, step: PredictionStep) -> bool:
        """Whether more samples may name another effect."""
        return not step.decided and (self.promised == 0.0 or bool(step.tied))

    def _evaluate_in(self, most: int, parent: Refit, *, first_look: bool = False) -> PredictionStep:
        """The same in about so many samples; a first look that leaves open what is missing evaluates single effects."""
        some = self.estimation.subsampled(most)
        fit = parent if some is self.estimation else refit_or_none(some, parent.model, None, parent)
        if fit is None or fit is parent:
            return self._evaluate_all(parent, self.estimation)
        view = replace(self, estimation=some)
        step = PredictionView._evaluate_all(view, fit, self.estimation, first_look=first_look)
        return replace(step, parent=parent, whole=self.estimation)

    def _evaluate_all(self, parent: Refit, whole: EstimationProblem, *, first_look: bool = False) -> PredictionStep:
        """The same in all samples; what excites the axis is said of the whole records."""
        effects, options = self.choices(parent.model), self.options
        proposed = proposals(parent.model, effects, self.estimation.conditions)
        screen = Screen(self.estimation, parent, self.options.seed)
        screened = screen.all(proposed, self._part(0.15, 0.4, "screening"))
        choices = sum(one.choices for one in screened)
        bar = 2.0 * math.log(max(choices, 1) / options.level)
        confirmed = self._confirmed(parent, screened, bar)
        responds = self.follows or responds_to_command(self.estimation, parent)
        confirmed += non_local_searches(
            self.estimation, parent, self.start, effects, self.options.seed, responds=responds
        )
        confirmed = _best_of_each(confirmed)
        evaluator = _Evaluator(parent)
        singles = evaluator([((one.proposal,), one.fit) for one in confirmed if one.gain >= LEAST_GAIN])
        step = PredictionStep(
            parent, tuple(singles), choices, options.level, options.minimum_improvement, tuple(proposed),
            gate(parent.model, whole, screened, bar), estimation=self.estimation,
            unseen=(self.estimation if self.held_out is None else self.held_out).records,
        )  # fmt: skip
        step = self._judged(step, responds)
        if first_look and self._leaves_open(step):
            return step
        left = fitted_curves(screen, options.level)
        step = replace(step, residual_curves=tuple(PredictionCurve.evaluated(screen, left, evaluator.innovations)))
        if self.promised == 0.0 and not self.balances(parent.model) and not step.tied and not step.confounded:
            pairs = evaluator(self._pairs(screen, screened, confirmed, bar))
            step = self._with_first(
                self._judged(replace(step, evaluated=(*step.evaluated, *pairs)), responds), evaluator
            )
        if responds or step.tied:
            return step
        response = missing_response(self.estimation, parent, self.start, options.seed)
        # Where the command does not move the axis, a force over the motion has no meaning.
        reversed_ = response is CommandResponse.REVERSED
        curves = tuple(one for one in step.residual_curves if one.of_the_drive and not reversed_)
        return replace(step, response=response, residual_curves=curves)

    def _part(self, begin: float, width: float, what: str) -> Progress:
        """Report a part of the work."""
        return lambda share, text: self.options.report(begin + width * share, f"{what} {text}")

    def _confirmed(self, parent: Refit, screened: list[Screened], bar: float) -> list[Confirmed]:
        """Refits of what the score test does not rule out."""
        # What a force balance has left is known to colour the noise.
        absorbed = not self.balances(parent.model) and _absorbed_by_noise(parent)
        # A score test does not show what the noise model has absorbed.
        chance = 2.0 * math.log(max(len(screened), 1))
        chosen = promising(screened, chance) if absorbed else promising(screened, bar, fewest=0)
        chosen += [s for s in _with_unreliable_score(screened, parent) if s not in chosen]
        least = self.promised * float(np.sum(parent.residual() ** 2))
        chosen = [s for s in chosen if s.promised >= least]
        report = self._part(0.55, 0.2, "refitting with")
        found = confirm(
            self.estimation, parent, chosen, report, lambda first: absorbed or _may_become_significant(first, bar)
        )
        if absorbed and (not found or _absorbed_by_noise(found[0].fit)):
            report = self._part(0.75, 0.1, "refitting under restricted noise with")
            found = _best_of_each([*found, *refit_under_restricted_noise(self.estimation, parent, screened, report)])
        return found

    def _pairs(self, screen: Screen, screened: list[Screened], confirmed: list[Confirmed], bar: float) -> list[_Fitted]:
        """Models with two effects that may show only together."""
        both = confirmed_pairs(screen, screened, bar, self._part(0.85, 0.1, "refitting with"))
        found: list[_Fitted] = [((one.beside, one.proposal), one.fit) for one in both if one.beside is not None]
        for base in () if whitened(screen.parent) else confirmed:
            if not base.proposal.effect.parameters:
                beside = candidates_beside(self.estimation, base.fit, self.options.effects, self.options.seed)
                found += [((base.proposal, one.proposal), one.fit) for one in beside]
        return found

    def _with_first(self, step: PredictionStep, evaluator: _Evaluator) -> PredictionStep:
        """With the first effect of the best pair alone, which is a step of the ladder."""
        if not step.tied or any(one.names == step.tied[0].names[:1] for one in step.evaluated):
            return step
        first, best = step.tied[0].proposals[0], step.tied[0].fit
        prefix = f"{first.name}."
        own = {name.removeprefix(prefix): v for name, v in best.model.values.items() if name.startswith(prefix)}
        fit = refit_or_none(self.estimation, first.model(own), None, step.parent)
        return step if fit is None else replace(step, evaluated=(*step.evaluated, *evaluator([((first,), fit)])))

    def _judged(self, step: PredictionStep, responds: bool) -> PredictionStep:
        """With the reasons for which significant effects are not named."""
        singles = [one for one in step.significant if len(one.proposals) == 1]
        rejected = {one.names[0]: self._rejection(step, one.proposals[0], one.fit, responds) for one in singles}
        rejected |= _within_rounding(
            step, [one for one in singles if rejected[one.names[0]] == WITHIN_QUANTUM], singles
        )
        rejected |= self._unsupported(step, [one for one in singles if not rejected[one.names[0]]])
        undetermined = {}
        # Errors of a free run are model errors, beside which a standard error says little.
        if self.estimation.kind == PREDICTION and singles:
            parent = step.parent.with_stderr()
            undetermined = {
                one.names[0]: undetermined_with(parent, one.fit.with_stderr(), one.proposals[0]) for one in singles
            }
        return replace(
            step,
            rejected={name: why for name, why in rejected.items() if why},
            undetermined={name: why for name, why in undetermined.items() if why},
        )

    def _rejection(self, step: PredictionStep, proposal: Proposal, fit: Refit, responds: bool) -> str:
        """Why a significant effect is not named; empty where it is."""
        model, effect = fit.model, proposal.effect
        if why := bound_reached(model, proposal):
            return why
        if proposal.replaces is None and (effect.site == OUTPUT or effect.hidden_by_start):
            without = model.without_effect(proposal.name)
            if effect.site == OUTPUT and within_quantisation(model, without, proposal.at, self.estimation.records):
                return WITHIN_QUANTUM
            if effect.hidden_by_start and same_motion_from_another_place(model, without, self.estimation.records):
                return "another initial state explains the same"
        if self.held_out is not None:
            if id(fit) not in step.held:
                step.held[id(fit)] = fit, holds(self.held_out.subsampled(ENOUGH), step.parent, proposal, fit)
            if not step.held[id(fit)][1]:
                return "it makes the errors on the held-out records larger"
        if not responds and not responds_to_command(self.estimation, fit):
            return "the motion does not follow the command with it either"
        return ""

    def _unsupported(self, step: PredictionStep, singles: Sequence[EvaluatedModel[Refit]]) -> dict[str, str]:
        """Effects that gain no likelihood where they must as well, and why they are not named."""
        matter = [one for one in singles if step.practically_significant(one)]
        without = None if self.support is None or not matter else refit_or_none(self.support, step.parent.model)
        if self.support is None or without is None:
            return {}
        found = {}
        for one in matter:
            fit = refit_or_none(self.support, one.fit.model, None, without)
            gain = 0.0 if fit is None else max(fit.log_likelihood - without.log_likelihood, 0.0)
            if gain < step.threshold():
                found[one.names[0]] = (
                    f"by {self.support.kind} it gains {gain:.2g} units of log-likelihood only, and"
                    f" {step.threshold():.2g} is asked for: a disturbance with a memory explains the same"
                )
        return found

    def reported(self, fit: Refit) -> Model:
        """As in `View`."""
        return fit.with_stderr()

    def refit_thoroughly(self, fit: Refit) -> Refit:
        """The same model in all samples, with the order of whitening that suits it."""
        if self.estimation.kind != PREDICTION:
            few = self.estimation.subsampled(FEW) is not self.estimation
            # Its initial states are those of the segments of a few samples.
            return (refit_or_none(self.estimation, fit.model, near=True) or fit) if few else fit
        # The order of the whitening that suited the model before need not suit it now.
        fit = refit(self.estimation, fit.model, None, fit, choose_orders=True)
        return search_repeatedly(self.estimation, fit) if has_contacts(fit.model) else fit

    def with_timing(self, step: SearchStep[Refit]) -> tuple[PredictionView, Refit] | None:
        """The view with an earlier command and the parent fitted in it, where that may be what an effect explains.

        No effect acts before its command. Stamps may be late, and a simulation that integrates in steps is early by
        half a step: a resonance resembles that. Where the best effect explains far more, it is named first, and the
        time of the command is looked for beside it: without the effect another time would be found.
        """
        if self.timed or self.estimation.kind != PREDICTION:
            return None
        some = self.estimation.subsampled(FEW)
        parent = refit_or_none(some, step.parent.model, None, step.parent)
        if parent is None:
            return None
        shift, gain = earlier_command(some, parent, step.threshold())
        if gain < step.threshold():
            return None
        best = refit_or_none(some, step.tied[0].fit.model, None, parent) if step.tied else None
        if best is not None and gain < _COMPARABLE * (best.log_likelihood - parent.log_likelihood):
            return None
        held_out = None if self.held_out is None else self.held_out.with_later_command(shift)
        view = replace(self, estimation=self.estimation.with_later_command(shift), held_out=held_out, timed=True)
        fit = refit_or_none(view.estimation, step.parent.model, None, step.parent)
        return None if fit is None else (view, fit)

    def refitted(self, model: Model, fit: Refit) -> Model | None:
        """As in `View`, in all samples."""
        found = refit_or_none(self.estimation, model, None, fit)
        return None if found is None else found.with_stderr()

    def without(self, fit: Refit, name: str) -> Refit | None:
        """The model without one of its effects, where its evidence is no less; else None."""
        if is_none(fit.model, name):
            return refit_or_none(self.estimation, fit.model.without_effect(name), None, fit)
        if self.balances(fit.model):
            # Where model error remains, a step that helped stays in the ladder.
            return None
        smaller = fit.model.without_effect(name)
        if self.estimation.kind != PREDICTION:
            # Model error makes a loss of likelihood larger than it is, never smaller.
            found = refit_or_none(self.estimation, smaller, None, fit)
            lost = math.inf if found is None else fit.log_likelihood - found.log_likelihood
            return found if lost < math.log(1.0 / self.options.level) else None
        scores = InnovationScores(fit).scores()
        # A search from the noise of the fit is mostly enough; where it is not, one that begins anew decides.
        for beside in (fit, None):
            found = refit_or_none(self.estimation, smaller, None, beside)
            if found is None:
                continue
            evidence = scores.against(InnovationScores(found).scores())
            if evidence.log < math.log(1.0 / self.options.level):
                return found
            # No other search makes up for that.
            if evidence.log > 60.0:
                break
        return None


def _look_alike(one: Proposal, other: Proposal) -> bool:
    """Whether two effects are the same or often confounded."""
    a, b = one.effect, other.effect
    return a.name == b.name or a.name in b.looks_like or b.name in a.looks_like


def _within_rounding(
    step: PredictionStep, off: Sequence[EvaluatedModel[Refit]], singles: Sequence[EvaluatedModel[Refit]]
) -> dict[str, str]:
    """Effects that explain no more than readings which are some part of a quantum off, and why they are not named."""
    return {
        one.names[0]: READINGS_OFF
        for one in singles
        for other in off
        if one is not other and not step.conclusive(one.scores.against(other.scores))
    }


class _Evaluator:
    """Evaluates fitted models against one without their effects."""

    def __init__(self, parent: Refit) -> None:
        self.parent, self.innovations = parent, InnovationScores(parent)
        self.base = self.innovations.scores()

    def __call__(self, choices: Sequence[_Fitted]) -> list[EvaluatedModel[Refit]]:
        """Effects, and the models that have them fitted, with the evidence for them."""
        scores = in_parallel(lambda choice: self._scores(choice[1]), choices)
        return [
            EvaluatedModel(proposals, fit, one, one.against(self.base), fit.log_likelihood - self.parent.log_likelihood)
            for (proposals, fit), one in zip(choices, scores, strict=True)
            if one is not None
        ]

    def _scores(self, fit: Refit) -> Scores | None:
        """Scores of a candidate; None where it cannot be scored."""
        try:
            scores = InnovationScores(fit).scores()
        except (IdloopError, np.linalg.LinAlgError):
            return None
        # Bodies that an effect adds have an unknown start: what the start loses does not count.
        scores = replace(scores, start=max(scores.start, self.base.start))
        return scores if np.all(np.isfinite(scores.log_density)) else None


def earlier_command(estimation: EstimationProblem, parent: Refit, least: float = 0.0) -> tuple[float, float]:
    """The shift of the command [s], at most a sample earlier, that explains most, and what it gains [log-likelihood].

    Parameters
    ----------
    estimation : EstimationProblem
    parent : Refit
        Of the model, to these data.
    least : float
        Gain of interest: where a small shift promises less over a whole sample, it is not looked for.
    """
    from scipy.optimize import minimize_scalar

    gains = {0.0: 0.0}

    def loss(shift: float) -> float:
        moved = estimation.with_later_command(shift)
        fit = refit_or_none(moved, parent.model, None, parent, rounds=_SHIFT_ROUNDS, near=True)
        gains[shift] = -math.inf if fit is None else fit.log_likelihood - parent.log_likelihood
        return -gains[shift]

    period = min(one.sample_time for one in estimation.data)
    # The log-likelihood is concave over the shift: nowhere does it gain more than at the rate of its start.
    promised = -loss(-_FIRST_SHIFT * period) / _FIRST_SHIFT
    if promised > least:
        minimize_scalar(loss, bounds=(-period, 0.0), method="bounded", options={"xatol": _SHIFT_STEP * period})
    best = max(gains, key=lambda shift: gains[shift])
    return float(best), gains[best]


def holds(held_out: EstimationProblem, parent: Refit, proposal: Proposal, fit: Refit) -> bool:
    """Whether an effect does no harm on records that the fits, without it and with it, did not see.

    No when the log-likelihood there falls by more than chance and the effect, fitted to those records, does not show
    there with about the same strength. Values alone decide nothing: while other effects are missing, the parameters
    compensate for them differently at each amplitude.
    """
    before, after = (transfer(held_out, one, own_disturbance=True) for one in (parent, fit))
    if after is None:
        return False
    if before is None or not beyond_chance(before.log_likelihood - after.log_likelihood, before, after):
        return True
    without = refit_or_none(held_out, before.model, None, before)
    if without is None:
        return False
    starts = [after.model.theta, *points(without, after.model, None)]
    found = refit_or_none(held_out, after.model, starts, without)
    if found is None or not distinguishable(found, without):
        return False
    strength = f"{proposal.name}.{proposal.effect.strength}"
    there, here = (one.model.values.get(strength, 1.0) for one in (found, fit))
    return there * here > 0.0 and max(there / here, here / there) < 2.0


def delay_or_lag(model: Model, name: str, estimation: EstimationProblem, options: Options) -> tuple[Candidate, ...]:
    """What predictions name instead of a lagging effect at the input that a force balance has found, best first.

    In the windows of a force balance a delay and a lag look alike. Empty for other effects, and where predictions name
    that effect or nothing.
    """
    active = next((active for active in model.effects if active.name == name), None)
    if active is None or active.effect.site != INPUT or not active.effect.lags:
        return ()
    without = refit_or_none(estimation, model.without_effect(name))
    if without is None:
        return ()
    asked = Options(options.level, 0.0, [name, *active.effect.looks_like], options.seed)
    step = PredictionView(estimation, model, asked).evaluate(without)
    if not step.tied or step.names == (name,):
        return ()
    return tuple(candidate_of(step, one, 0, step.reported(one.fit)) for one in step.tied)


def bound_reached(model: Model, proposal: Proposal) -> str:
    """Say that the strength of a fitted effect is at its bound; empty where it is not.

    Only the bound kept it from growing: it is confounded with something, or with the scale of all forces, as friction
    that takes a share of the drive's force is. Of an effect that replaces a simpler one, the strength is what it has
    beyond that.
    """
    sought = {proposal.effect.strength} if proposal.replaces is None else proposal.beyond
    for spec in proposal.effect.parameters:
        key = f"{proposal.name}.{spec.name}"
        # An optional parameter is a share, whose bound is all of it.
        if spec.name not in sought or spec.optional or key not in model.free:
            continue
        for bound in (spec.min, spec.max):
            way = abs(bound - spec.neutral)
            # A search stops within a thousandth of the way to the bound.
            if math.isfinite(way) and way > 0.0 and abs(model.values[key] - bound) <= 1e-3 * way:
                return f"its {spec.name} ended at the bound of what makes sense, {bound:g}"
    return ""


def _best_of_each(found: Sequence[Confirmed]) -> list[Confirmed]:
    """The best of several searches for each effect, in order of rising gain."""
    return list({one.proposal.name: one for one in sorted(found, key=lambda one: one.gain)}.values())


def _may_become_significant(first: Confirmed, bar: float) -> bool:
    """Whether an effect may still become significant after the first round of its search.

    An effect that replaces a simpler one begins far from its optimum, with a disturbance that is too strong: after one
    round it may still be worse than what it replaces, and the score test is more reliable.
    """
    if first.proposal.replaces is not None:
        reached = max(2.0 * first.gain, first.statistic)
    else:
        reached = 2.0 * first.gain if first.proposal.effect.slow else first.statistic
    return reached > STILL_IN_IT * bar


def _absorbed_by_noise(fit: Refit) -> bool:
    """Whether the noise model has absorbed an effect.

    A free whitening reproduces a filter, a resonance or a sensor error so well that the innovations show no effect.
    Whitening with few lags counts as noise unless it reduces the deviation of the errors by 2.5 [log], as a memory of
    a hundred samples would; with many lags 0.05 is enough.
    """
    if not isinstance(fit.criterion, InnovationCriterion):
        return False
    if fit.whitening_gain <= 0.05 or fit.whitening_gain > 2.5:
        return fit.whitening_gain > 2.5
    return max(choose_order(group) for group in fit.problem.errors(fit.point)) >= MANY_LAGS


def _with_unreliable_score(screened: list[Screened], parent: Refit) -> list[Screened]:
    """Effects with an unreliable score: those that would replace a simpler one or split a body, and slow forces.

    The fitted values may be those of one part of a split body, far from those of both. A long memory of the noise may
    absorb slow forces; of those that act on all bodies alike, the first body's counts.
    """
    if not isinstance(parent.criterion, InnovationCriterion):
        return []
    remembers = parent.criterion.memory >= LONG_MEMORY or any(parent.problem.orders)

    def slow(proposal: Proposal) -> bool:
        alike = proposal.effect.anywhere and proposal.at not in (INPUT, parent.model.bodies[0])
        return remembers and proposal.effect.slow and not alike

    return [
        s
        for s in screened
        if s.traces and (s.proposal.replaces is not None or s.proposal.effect.splits or slow(s.proposal))
    ]
