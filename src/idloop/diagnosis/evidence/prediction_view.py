"""One step of a diagnosis by one-step or free-run errors: which effects explain errors that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.diagnosis import candidate_of
from idloop.diagnosis.equivalence.same_motion import same_from_another_start, same_motion, within_rounding
from idloop.diagnosis.evidence.force_view import unbalanced
from idloop.diagnosis.evidence.held_out import holds
from idloop.diagnosis.evidence.predictive import Scores
from idloop.diagnosis.identifiability import gate
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.options import PREDICTION
from idloop.diagnosis.residual_curves.learnt_curves import LearntCurve, remaining
from idloop.diagnosis.screening.command_response import CommandResponse, follows, reversed_command
from idloop.diagnosis.screening.granger_test import foretells
from idloop.diagnosis.screening.innovation_scores import InnovationScores
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screen, Screened
from idloop.diagnosis.search.confirm import STILL_IN_IT, Confirmed, Progress, confirm, confirm_behind_noise, promising
from idloop.diagnosis.search.non_local_search import beside_bare, far_searches, white
from idloop.diagnosis.search.pairs import confirmed_pairs
from idloop.diagnosis.search.step import ADEQUATE, NOT_EXCITED, UNKNOWN, Step, View, Weighed
from idloop.errors import IdloopError
from idloop.estimation.likelihood.disturbance import LONG_MEMORY
from idloop.estimation.likelihood.estimation_problem import ENOUGH, EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import MANY_LAGS, Refit, refit, refit_or_none
from idloop.estimation.likelihood.restarts import has_contacts, search_repeatedly
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.statistics.whitening import choose_order
from idloop.physics.effect import INPUT, OUTPUT
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.measures import NEGLIGIBLE

# Effects, one or two, and the model that has them fitted.
_Fitted = tuple[tuple[Proposal, ...], Refit]


@dataclass(frozen=True)
class PredictionStep(Step[Refit]):
    """What one step has weighed by one-step or free-run errors."""

    estimation: EstimationProblem = field(kw_only=True)  # what was fitted
    unseen: tuple[Record, ...] = field(kw_only=True)  # their free run tells whether an effect is worth a name
    whole: EstimationProblem | None = None  # all samples, where effects were weighed in some of them only
    response: CommandResponse = CommandResponse.FOLLOWS  # of the motion to the command
    # Fits with the part by which each makes errors smaller, and with whether each holds on the held-out records.
    known: dict[int, tuple[Refit, float]] = field(default_factory=dict, compare=False)
    held: dict[int, tuple[Refit, bool]] = field(default_factory=dict, compare=False)

    @property
    def criterion(self) -> str:
        """What the models are measured by."""
        return self.estimation.kind

    def smaller(self, one: Weighed[Refit]) -> float:
        """Part by which an effect makes errors smaller: those one sample ahead, or those of the free run."""
        if id(one.fit) not in self.known:
            part = one.evidence.improvement
            splits = any(proposal.effect.splits for proposal in one.proposals)
            if not splits and same_motion(one.fit.model, self.parent.model, self.estimation.records):
                part = 0.0
            elif not part >= self.least:
                part = max(part, self._of_the_free_run(one.fit.model))
            self.known[id(one.fit)] = one.fit, part
        return self.known[id(one.fit)][1]

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
            if np.any(was > 0.0):
                parts.append(1.0 - float(np.linalg.norm(now) / np.linalg.norm(was)))
        return max(parts)

    def _equal(self, best: Weighed[Refit], other: Weighed[Refit]) -> bool:
        # The noise is modelled: a difference counts as it is.
        against = best.scores.against(other.scores)
        return against.difference + against.start <= math.log(1.0 / self.level)

    def only_together(self, pair: Weighed[Refit]) -> bool:
        """Whether each of two effects is needed beside the other."""
        alone = [one for one in self.weighed if len(one.names) == 1 and one.names[0] in pair.names]
        beyond = [pair.scores.against(one.scores) for one in alone]
        if len({one.names[0] for one in alone}) < len(pair.names):
            beyond.append(pair.evidence)
        return all(map(self.shows, beyond))

    def too_small(self, one: Weighed[Refit]) -> str:
        """Why an effect that shows is not worth a name."""
        part = max(self.smaller(one), 0.0)
        if part == 0.0:
            return f"it moves no output by more than {100.0 * NEGLIGIBLE:g} % of its standard deviation"
        return (
            f"it makes errors on unseen samples smaller by {100.0 * part:.3g} % only, and {100.0 * self.least:g} % is "
            "asked for"
        )

    def reported(self, fit: Refit) -> Model:
        """A fitted model with its standard errors; what was weighed in some samples is fitted to all first."""
        estimation = self.estimation if self.whole is None else self.whole
        if self.whole is not None and any(fit is one.fit for one in self.weighed):
            fit = refit_or_none(estimation, fit.model, None, self.parent) or fit
        return fit.with_stderr()

    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """What is left when no effect is named."""
        follows = self.response is CommandResponse.FOLLOWS
        findings = () if follows else (self.response.text,)
        if self.structure is not None or self.response is CommandResponse.OTHERWISE:
            return UNKNOWN, findings
        return (NOT_EXCITED if self.gate.poor or not follows else ADEQUATE), findings


@dataclass(frozen=True)
class PredictionView(View[Refit]):
    """Weighs what could be added to a model by its one-step errors, or those of its free run.

    On held-out records an effect must do no harm. Of the model `weighed` a force balance has weighed all that it
    shows: this is not weighed again.
    """

    estimation: EstimationProblem
    start: Model  # as the user gave it
    level: float
    least: float
    effects: Sequence[str] | None = None  # to choose from
    held_out: EstimationProblem | None = None
    seed: int = 0
    tell: Progress = lambda share, text: None
    weighed: Model | None = None

    def beside(self, model: Model, *, balanced: bool) -> PredictionView:
        """The same view after a force balance has led to a model; balanced: what it shows is not weighed again."""
        return replace(self, start=model, weighed=model if balanced else None)

    def choices(self, model: Model) -> Sequence[str] | None:
        """What there is to choose from beside a model; None for the whole catalogue."""
        if self.weighed is None:
            return self.effects
        return unbalanced(model, self.effects, self.estimation.conditions, self.weighed)

    def weigh(self, parent: Refit) -> Step[Refit]:
        """Weigh the effects of the catalogue that a score test finds promising, and pairs of them."""
        some = self.estimation.subsampled(ENOUGH)
        fit = parent if some is self.estimation else refit_or_none(some, parent.model, None, parent)
        if fit is None or fit is parent:
            return self._in_all(parent)
        step = PredictionView._in_all(replace(self, estimation=some), fit)
        return replace(step, parent=parent, whole=self.estimation)

    def _in_all(self, parent: Refit) -> PredictionStep:
        """The same in all samples."""
        effects = self.choices(parent.model)
        asked = proposals(parent.model, effects, self.estimation.conditions)
        screen = Screen(self.estimation, parent, self.seed)
        screened = screen.all(asked, self._part(0.15, 0.4, "screening"))
        bar = 2.0 * math.log(max(len(asked), 1) / self.level)
        confirmed = self._confirmed(parent, screened, bar)
        confirmed += far_searches(self.estimation, parent, self.start, effects, self.seed)
        confirmed = _best_of_each(confirmed)
        weigher = _Weigher(parent)
        # What has gained less than two units of log-likelihood is not worth weighing.
        singles = weigher([((one.proposal,), one.fit) for one in confirmed if one.gain >= 2.0])
        step = PredictionStep(
            parent, tuple(singles), len(asked), self.level, self.least, tuple(asked),
            gate(parent.model, self.estimation, screened, bar), estimation=self.estimation,
            unseen=(self.estimation if self.held_out is None else self.held_out).records,
        )  # fmt: skip
        moved = follows(self.estimation, parent)
        step = self._judged(step, moved)
        left = remaining(screen, self.level)
        step = replace(step, structures=tuple(LearntCurve.weighed(screen, left, weigher.innovations)))
        if self.estimation.kind == PREDICTION and self.weighed is None and not step.tied and not step.stand_ins:
            pairs = weigher(self._pairs(screen, screened, confirmed, bar))
            step = self._with_first(self._judged(replace(step, weighed=(*step.weighed, *pairs)), moved), weigher)
        if moved or step.tied:
            return step
        response = CommandResponse.UNMOVED
        if reversed_command(self.estimation, parent, self.start):
            response = CommandResponse.REVERSED
        elif foretells(self.estimation.records, self.seed):
            response = CommandResponse.OTHERWISE
        # A force over the motion says nothing where it is not the command that moves the axis.
        turned = response is CommandResponse.REVERSED
        curves = tuple(one for one in step.structures if one.of_the_drive and not turned)
        return replace(step, response=response, structures=curves)

    def _part(self, begin: float, width: float, what: str) -> Progress:
        """Tells a part of the work."""
        return lambda share, text: self.tell(begin + width * share, f"{what} {text}")

    def _confirmed(self, parent: Refit, screened: list[Screened], bar: float) -> list[Confirmed]:
        """Refits of what the score test does not rule out."""
        # What a balance has left is known to colour the noise.
        swallowed = self.weighed is None and _swallowed(parent)
        # What the noise model has swallowed a score test does not see.
        chance = 2.0 * math.log(max(len(screened), 1))
        chosen = promising(screened, chance) if swallowed else promising(screened, bar, fewest=0)
        chosen += [s for s in _judged_by_refit(screened, parent) if s not in chosen]
        telling = self._part(0.55, 0.2, "refitting with")
        found = confirm(self.estimation, parent, chosen, telling, lambda first: swallowed or _may_decide(first, bar))
        if swallowed and (not found or _swallowed(found[0].fit)):
            telling = self._part(0.75, 0.1, "looking behind noise:")
            found = _best_of_each([*found, *confirm_behind_noise(self.estimation, parent, screened, telling)])
        return found

    def _pairs(self, screen: Screen, screened: list[Screened], confirmed: list[Confirmed], bar: float) -> list[_Fitted]:
        """Two effects each that may show only together."""
        both = confirmed_pairs(screen, screened, bar, self._part(0.85, 0.1, "refitting with"))
        found: list[_Fitted] = [((one.beside, one.proposal), one.fit) for one in both if one.beside is not None]
        for bare in () if white(screen.parent) else confirmed:
            if not bare.proposal.effect.parameters:
                beside = beside_bare(self.estimation, bare.fit, self.effects, self.seed)
                found += [((bare.proposal, one.proposal), one.fit) for one in beside]
        return found

    def _with_first(self, step: PredictionStep, weigher: _Weigher) -> PredictionStep:
        """With the first effect of the best pair by itself, where a ladder comes by."""
        if not step.tied or any(one.names == step.tied[0].names[:1] for one in step.weighed):
            return step
        first, best = step.tied[0].proposals[0], step.tied[0].fit
        prefix = f"{first.name}."
        own = {name.removeprefix(prefix): v for name, v in best.model.values.items() if name.startswith(prefix)}
        fit = refit_or_none(self.estimation, first.model(own), None, step.parent)
        return step if fit is None else replace(step, weighed=(*step.weighed, *weigher([((first,), fit)])))

    def _judged(self, step: PredictionStep, moved: bool) -> PredictionStep:
        """With the reasons for which effects that show are not named."""
        singles = [one for one in step.significant if len(one.proposals) == 1]
        refused = {one.names[0]: self._refused(step, one.proposals[0], one.fit, moved) for one in singles}
        return replace(step, refused={name: why for name, why in refused.items() if why})

    def _refused(self, step: PredictionStep, proposal: Proposal, fit: Refit, moved: bool) -> str:
        """Why an effect that shows is not named; empty where it is."""
        model, effect = fit.model, proposal.effect
        if why := at_its_bound(model, proposal):
            return why
        if proposal.replaces is None and (effect.site == OUTPUT or effect.hidden_by_start):
            without = model.without_effect(proposal.name)
            if effect.site == OUTPUT and within_rounding(model, without, proposal.at, self.estimation.records):
                return "it moves the reading by less than half a step of its rounding"
            if effect.hidden_by_start and same_from_another_start(model, without, self.estimation.records):
                return "another start does the same"
        if self.held_out is not None:
            if id(fit) not in step.held:
                step.held[id(fit)] = fit, holds(self.held_out, step.parent, proposal, fit)
            if not step.held[id(fit)][1]:
                return "it does harm on the unseen data"
        if not moved and not follows(self.estimation, fit):
            return "with it, too, the motion does not follow the command"
        return ""

    def again(self, fit: Refit) -> Refit:
        """The same model, with the order of whitening that suits it."""
        if self.estimation.kind != PREDICTION:
            return fit
        # The order of the whitening that suited the model before need not suit it now.
        fit = refit(self.estimation, fit.model, None, fit, choose_orders=True)
        return search_repeatedly(self.estimation, fit) if has_contacts(fit.model) else fit

    def without(self, fit: Refit, name: str) -> Refit | None:
        """The model without one of its effects, where that says as much of unseen samples; None where it does not."""
        # Once a body is split the balance along its measured motion is no longer that of the machine.
        balanced = self.weighed is not None and not fit.model.inner_couplings
        if self.estimation.kind != PREDICTION or balanced:
            # Where model error is what is left, a step that helped stays for the reader to see.
            return None
        smaller, scores = fit.model.without_effect(name), InnovationScores(fit).scores()
        # A search from the fit's own noise mostly ends far behind; where it does not, one that begins anew decides.
        for beside in (fit, None):
            found = refit_or_none(self.estimation, smaller, None, beside)
            if found is None:
                continue
            evidence = scores.against(InnovationScores(found).scores())
            if evidence.log < math.log(1.0 / self.level):
                return found
            # No other search finds a model that does without.
            if evidence.log > 60.0:
                break
        return None


class _Weigher:
    """Weighs fitted models against one without what they have."""

    def __init__(self, parent: Refit) -> None:
        self.parent, self.innovations = parent, InnovationScores(parent)
        self.base = self.innovations.scores()

    def __call__(self, choices: Sequence[_Fitted]) -> list[Weighed[Refit]]:
        """Effects, and the models that have them fitted, with the evidence for them."""
        scores = in_parallel(lambda choice: self._scores(choice[1]), choices)
        return [
            Weighed(proposals, fit, one, one.against(self.base), fit.log_likelihood - self.parent.log_likelihood)
            for (proposals, fit), one in zip(choices, scores, strict=True)
            if one is not None
        ]

    def _scores(self, fit: Refit) -> Scores | None:
        """Scores of a candidate; None where it cannot be scored."""
        try:
            scores = InnovationScores(fit).scores()
        except (IdloopError, np.linalg.LinAlgError):
            return None
        # Bodies that are new with an effect start somewhere: what a start loses does not count.
        scores = replace(scores, start=max(scores.start, self.base.start))
        return scores if np.all(np.isfinite(scores.log_density)) else None


def delay_or_lag(
    model: Model, name: str, estimation: EstimationProblem, level: float, seed: int
) -> tuple[Candidate, ...]:
    """What predictions name in the place of an effect before the drive that a force balance has found, best first.

    A window of a balance sees a delay and a lag alike: by what they make of quick changes of the command. Empty where
    the effect has no memory or does not act on the command, and where predictions name just that or nothing.
    """
    active = next((active for active in model.effects if active.name == name), None)
    if active is None or active.effect.site != INPUT or not active.effect.lags:
        return ()
    bare = refit_or_none(estimation, model.without_effect(name))
    if bare is None:
        return ()
    step = PredictionView(estimation, model, level, 0.0, [name, *active.effect.looks_like], seed=seed).weigh(bare)
    if not step.tied or step.names == (name,):
        return ()
    return tuple(candidate_of(step, one, 0, step.reported(one.fit)) for one in step.tied)


def at_its_bound(model: Model, proposal: Proposal) -> str:
    """Say that the strength of a fitted effect ended where no larger one makes sense; empty where it did not.

    Nothing but the bound kept it from growing: it stands in for something, or for the scale of all forces, which
    friction that takes a share of the drive's force imitates while the axis is only driven. Of an effect that takes a
    plainer one's place, what makes it more than that is its strength.
    """
    sought = {proposal.effect.strength} if proposal.replaces is None else proposal.beyond
    for spec in proposal.effect.parameters:
        key = f"{proposal.name}.{spec.name}"
        # What may go another parameter's way is a share, and all of it is one.
        if spec.name not in sought or spec.optional or key not in model.free:
            continue
        for bound in (spec.min, spec.max):
            way = abs(bound - spec.neutral)
            # A search stops within a thousandth of the way to the bound.
            if math.isfinite(way) and way > 0.0 and abs(model.values[key] - bound) <= 1e-3 * way:
                return f"its {spec.name} ended at the bound of what makes sense, {bound:g}"
    return ""


def _best_of_each(found: Sequence[Confirmed]) -> list[Confirmed]:
    """Of several searches for one effect the one that ended best, in order of rising gain."""
    return list({one.proposal.name: one for one in sorted(found, key=lambda one: one.gain)}.values())


def _may_decide(first: Confirmed, bar: float) -> bool:
    """Whether an effect may still show when its search has only had its first round.

    What takes a plainer effect's place begins far from where it is best, with the disturbance that was strong for
    want of it: after one round it may still be worse than what it replaces, and the score test tells more.
    """
    if first.proposal.replaces is not None:
        reached = max(2.0 * first.gain, first.statistic)
    else:
        reached = 2.0 * first.gain if first.proposal.effect.slow else first.statistic
    return reached > STILL_IN_IT * bar


def _swallowed(fit: Refit) -> bool:
    """Whether the noise model explains what no noise would.

    A free whitening imitates a filter, a resonance or a sensor's error so well that its innovations show no effect any
    more. Noise of few lags is taken for noise, unless these make the errors' deviations smaller than a memory of a
    hundred samples would, by 2.5 [log]; many lags by 0.05 do.
    """
    if not isinstance(fit.criterion, InnovationCriterion):
        return False
    if fit.whitening_gain <= 0.05 or fit.whitening_gain > 2.5:
        return fit.whitening_gain > 2.5
    return max(choose_order(group) for group in fit.problem.errors(fit.point)) >= MANY_LAGS


def _judged_by_refit(screened: list[Screened], parent: Refit) -> list[Screened]:
    """Effects of which a score says little: those that would take a plainer one's place, and slow forces.

    A long memory of the noise may stand for the latter; of those that act on bodies alike, the first body's counts.
    """
    if not isinstance(parent.criterion, InnovationCriterion):
        return []
    remembers = parent.criterion.memory >= LONG_MEMORY or any(parent.problem.orders)

    def slow(proposal: Proposal) -> bool:
        alike = proposal.effect.anywhere and proposal.at not in (INPUT, parent.model.bodies[0])
        return remembers and proposal.effect.slow and not alike

    return [s for s in screened if s.traces and (s.proposal.replaces is not None or slow(s.proposal))]
