"""Climb the ladder: diagnose, add, refit, until nothing significant is left."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.diagnosis.candidate import Candidate, effect_parameters
from idloop.diagnosis.diagnosis import candidate_of, split_bodies
from idloop.diagnosis.evidence.deciding_view import NOTHING, Views, as_predicted, asked_fit
from idloop.diagnosis.evidence.force_view import ForceView, fitted_model
from idloop.diagnosis.evidence.prediction_view import PredictionView, delay_or_lag
from idloop.diagnosis.evidence.quantisation import quantised
from idloop.diagnosis.ladder import Ladder
from idloop.diagnosis.ladder import Step as LadderStep
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.options import (
    FORCE,
    MINIMUM_IMPROVEMENT,
    PREDICTION,
    check_numbers,
    first_kind,
    with_common_whitening,
)
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search.climb import Climb
from idloop.diagnosis.search.step import ADEQUATE, MISSING, FitT, View
from idloop.estimation.dataset import prepare
from idloop.estimation.direction import opposite_direction_warning
from idloop.estimation.force_balance.weak_fit import LEAST_UNEXPLAINED, WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import common_scale, effect_scales
from idloop.physics.effect_text import parse_effect
from idloop.physics.model import Model
from idloop.records import Record

Progress = Callable[[float, str], None]

# What raises the unexplained force by a tenth is not what was missing: parameters make up for it.
_SPOILT = 1.1


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def refine(
    model: Model,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    level: float = 0.01,
    criterion: str = "auto",
    minimum_improvement: float = MINIMUM_IMPROVEMENT,
    effects: Sequence[str] | None = None,
    seed: int = 0,
    most: int = 8,
    ladder: Ladder | None = None,
    progress: Progress | None = None,
    on_step: Callable[[Ladder], None] | None = None,
) -> Ladder:
    """Add the missing effects one by one, or two that show only together, until nothing significant is left.

    Parameters
    ----------
    model : Model
    records, validation : sequence of Record
        What is fitted, and what the fit does not see.
    level : float
        Family-wise error rate of every step.
    criterion, minimum_improvement, effects, seed
        As in `diagnose`.
    most : int
        Most effects to add.
    ladder : Ladder, optional
        Go on from this one.
    progress : callable, optional
    on_step : callable, optional
        Called with the ladder after every step.

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        As `diagnose`.
    """
    check_numbers(level, minimum_improvement)
    kind = first_kind(criterion)
    start = model if ladder is None else ladder.model
    together = common_scale(CachingEngine(start), prepare(start, records))
    if together is not None:
        start = together.fixed(start)
    task = _Task(
        model, records, validation, level, minimum_improvement, effects, seed, most,
        progress or (lambda share, text: None), on_step,
    )  # fmt: skip
    found, last = None, None
    # A ladder goes on by what it has been climbed by.
    wanted = (
        ladder.criterion if criterion == "auto" and ladder is not None and ladder.criterion != "auto" else criterion
    )
    if wanted in ("auto", FORCE):
        found, last = task.by_force(start, ladder, asked=wanted == FORCE)
        if wanted != FORCE:
            found = task.by_errors(start if found is None else found.model, found or ladder, PREDICTION, last)
    if found is None:
        found = task.by_errors(start, ladder, kind if wanted == criterion else wanted)
    told = ([] if together is None else [together]) + effect_scales(found.model, records)
    texts = [
        "" if found.response.tells_nothing else opposite_direction_warning(start, found.model),
        *(one.text for one in told),
        *split_bodies(found.model, found.added),
        views_apart(found),
    ]
    return replace(found, findings=(*found.findings, *(text for text in texts if text)))


def views_apart(ladder: Ladder) -> str:
    """What to say of a model that is adequate in one view and far off in free run; empty where it is not."""
    last = ladder.steps[-1]
    missed: Mapping[str, float] = (last.validation or last.train).get("nrmse", {})
    far = {name: share for name, share in missed.items() if not share < 1.0}
    if ladder.verdict != ADEQUATE or not far:
        return ""
    worst = max(far, key=lambda name: far[name] if math.isfinite(far[name]) else math.inf)
    error = f"is off by {100.0 * far[worst]:.3g} % of the signal" if math.isfinite(far[worst]) else "runs away"
    return (
        f"adequate by {ladder.criterion}, yet the free run of {worst} {error}: small errors of the force add up over a "
        "record, so use this model for forces and short predictions"
    )


@dataclass(frozen=True)
class _Task:
    """What was asked for; attributes as the parameters of `refine`."""

    model: Model
    records: Sequence[Record]
    validation: Sequence[Record]
    level: float
    least: float
    effects: Sequence[str] | None
    seed: int
    most: int
    tell: Progress
    on_step: Callable[[Ladder], None] | None

    def by_force(
        self, start: Model, ladder: Ladder | None, *, asked: bool
    ) -> tuple[Ladder, WeakFit] | tuple[Ladder | None, None]:
        """Climb by the force balance where it serves, to its last fit; as it was where that shows nothing."""
        estimation = with_common_whitening(prepare_estimation(start, self.records, "prediction", self.validation))
        forms: dict[int, WeakForm] = {}
        views = None if asked else Views(start, estimation, forms)
        fit = asked_fit(start, estimation, forms) if views is None else views.balance
        if views is not None and ladder is not None:
            # One that was interrupted has the values of the balance.
            ladder = self._as_predicted(ladder, -1, views.finer)
        if fit is None:
            return ladder, None
        held_out = prepare(start, self.validation, companions=self.records) if self.validation else []
        view = ForceView(estimation, self.level, self.least, self.effects, held_out, forms)
        found, last = self._climb(view, FORCE)(fit, ladder)
        if views is None:
            return found, last
        nothing = len(found.steps) == (1 if ladder is None else len(ladder.steps))
        if last.relative >= NOTHING or (not views.blind if nothing else views.contradict(found.model, self.level)):
            return ladder, None
        return (found if ladder is not None else self._as_predicted(found, 0, views.finer)), last

    def _as_predicted(self, ladder: Ladder, place: int, fit: Refit | None) -> Ladder:
        """The ladder with the model of a step fitted to prediction errors; as it was without a fit."""
        if fit is None:
            return ladder
        steps = list(ladder.steps)
        step = steps[place]
        added = None if step.added is None else as_predicted(step.added, fit, self.records)
        model = fit.with_stderr() if added is None or added.model is None else added.model
        train, unseen = model_errors(model, self.records), model_errors(model, self.validation)
        steps[place] = replace(step, added=added, model=model, train=train, validation=unseen)
        return replace(ladder, steps=tuple(steps))

    def by_errors(self, start: Model, ladder: Ladder | None, kind: str, last: WeakFit | None = None) -> Ladder:
        """Climb by one criterion; on from what the force balance has found, whose error must not become larger."""
        estimation = with_common_whitening(prepare_estimation(start, self.records, kind, self.validation))
        held_out = None
        if self.validation:
            held_out = replace(
                prepare_estimation(start, self.validation, kind, self.records), whiteners=estimation.whiteners
            )
        view = PredictionView(
            estimation, self.model, self.level, self.least, self.effects, held_out, self.seed, self.tell
        )  # fmt: skip
        if ladder is None or last is None:
            found, _ = self._climb(view, kind)(refit(estimation, start), ladder)
        else:
            found = self._go_on(view, self._told_apart(estimation, ladder), last)
        for candidate in quantised(found.model, estimation, self.effects):
            if len(found.added) < self.most:
                found = _with_resolution(found, candidate)
        return found

    def _go_on(self, view: PredictionView, ladder: Ladder, last: WeakFit) -> Ladder:
        """Climb on by predictions from what the force balance has found."""
        fit = refit_or_none(view.estimation, ladder.model, near=True)
        if fit is not None and not fit.many_lags:
            fit = refit_or_none(view.estimation, ladder.model)
        if fit is None or self._blind(fit.model, ladder, last):
            return ladder
        # What a balance leaves beyond its noise predictions would take for noise: they weigh what it does not see.
        # Where they need not whiten anything they are the finer view of all.
        ruled = last.usable and any(fit.problem.orders)
        view = view.beside(ladder.model, balanced=ruled)
        if view.choices(ladder.model) == []:
            return ladder
        trusted = not (last.model_error_dominates or last.contradicts(fit.model))
        ladder = self._as_predicted(ladder, -1, fit if trusted else None)
        more, _ = replace(self._climb(view, PREDICTION), spoils=self._spoils)(fit, ladder)
        return ladder.seconded(more) if ruled and more.added == ladder.added else more

    def _climb(self, view: View[FitT], criterion: str) -> Climb[FitT]:
        return Climb(view, self.records, self.validation, criterion, self.level, self.most, self.tell, self.on_step)

    def _told_apart(self, estimation: EstimationProblem, ladder: Ladder) -> Ladder:
        """The ladder with a delay or lag of the drive as predictions tell it."""
        for step in ladder.steps[1:]:
            if step.added is None or step.chosen_by == "user":
                continue
            told = delay_or_lag(ladder.model, step.added.name, estimation, self.level, self.seed)
            found = told[0] if told else step.added
            model = found.model
            if found is step.added or model is None or self._spoils(ladder.model, model):
                continue
            rung = replace(
                step, added=found, set=tuple(one.name for one in told), p_value=found.p_value, model=model,
                train=model_errors(model, self.records), validation=model_errors(model, self.validation),
            )  # fmt: skip
            ladder = replace(ladder, steps=(*(one for one in ladder.steps if one is not step), rung))
        return ladder

    def _blind(self, predicted: Model, ladder: Ladder, last: WeakFit) -> bool:
        """Whether a free disturbance has taken a part of the force for its own: such predictions see no better."""
        return self._spoils(ladder.model, predicted) if ladder.added else last.contradicts(predicted)

    def _spoils(self, before: Model, after: Model) -> bool:
        """Whether a model leaves more of the drive's force unexplained than another one.

        A body that is two has no balance of forces along its measured motion: there the free run tells.
        """
        was, now = (model_errors(one, self.validation or self.records) for one in (before, after))
        if after.inner_couplings:
            return any(error > _SPOILT * was["anew"].get(name, np.inf) for name, error in now["anew"].items())
        # Below its own error a balance tells no model from another.
        if was["force"] is None:
            return False
        return now["force"] is None or now["force"] > _SPOILT * max(was["force"], LEAST_UNEXPLAINED)


def _with_resolution(ladder: Ladder, candidate: Candidate) -> Ladder:
    """A sensor's resolution explains scatter; it moves no parameter and no free run."""
    model = ladder.model.with_entry(
        candidate.effect, candidate.at, {name: entry["value"] for name, entry in candidate.parameters.items()}
    )
    last = ladder.steps[-1]
    step = LadderStep(
        added=replace(candidate, model=model),
        model=model,
        set=(candidate.name,),
        p_value=candidate.p_value,
        train=last.train,
        validation=last.validation,
    )
    return replace(ladder, steps=(*ladder.steps, step))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def add_effect(
    ladder: Ladder,
    text: str,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    criterion: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Ladder:
    """Add the user's own choice instead of the proposed effect.

    Parameters
    ----------
    ladder : Ladder
    text : str
        ``effect@site`` or ``effect@site(parameter=value, ...)``.
    records, validation : sequence of Record
    criterion : str, optional
        That of the ladder when left out.
    seed : int
    progress : callable, optional

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        No such effect or site, or the model has it.
    """
    name, at, values = parse_effect(text)
    model = ladder.model
    tell = progress or (lambda share, text: None)
    tell(0.0, f"refitting with {name}@{at}")
    if (criterion or ladder.criterion) == FORCE:
        return _added_by_force(ladder, name, at, values, records, validation)
    kind = first_kind(criterion or ladder.criterion)
    estimation = with_common_whitening(prepare_estimation(model, records, kind))
    parent = refit(estimation, model)
    trial = model.with_effect(name, at, **values)
    if not values and any(p.name == f"{name}@{at}" for p in proposals(parent.model, None, estimation.conditions)):
        step = PredictionView(estimation, model, ladder.level, 0.0, [f"{name}@{at}"], seed=seed).weigh(parent)
        for found in step.weighed[:1]:
            model = step.reported(found.fit)
            return _chosen(ladder, candidate_of(step, found, 0, model), model, records, validation)
    fit = refit(estimation, trial, None, parent)
    fitted = fit.with_stderr()
    effect = next(a.effect for a in fitted.effects if a.name == f"{name}@{at}")
    candidate = Candidate(
        effect=name,
        at=at,
        testable="yes",
        why="chosen by the user",
        text=effect.text,
        gain=fit.log_likelihood - parent.log_likelihood,
        parameters=effect_parameters(fitted, f"{name}@{at}"),
        model=fitted,
    )
    return _chosen(ladder, candidate, fitted, records, validation)


def _added_by_force(
    ladder: Ladder,
    name: str,
    at: str,
    values: Mapping[str, float],
    records: Sequence[Record],
    validation: Sequence[Record],
) -> Ladder:
    """Add the user's own choice, fitted by the force balance from what the unexplained force promises."""
    estimation = prepare_estimation(ladder.model, records, "prediction", validation)
    parent = asked_fit(ladder.model, estimation, {})
    view = ForceView(estimation, ladder.level, 0.0)
    found = None if values else view.best_with(parent, name, at)
    trial = ladder.model.with_effect(name, at, **values) if found is None else found.model
    fit = asked_fit(trial, estimation, {})
    fitted, active = fitted_model(fit), trial.effects[-1]
    candidate = Candidate(
        effect=name,
        at=at,
        testable="yes",
        why="chosen by the user",
        text=active.effect.text,
        gain=fit.log_likelihood - parent.log_likelihood,
        parameters=effect_parameters(fitted, active.name),
        model=fitted,
        number=active.number,
    )
    return _chosen(ladder, candidate, fitted, records, validation)


def _chosen(
    ladder: Ladder, candidate: Candidate, model: Model, records: Sequence[Record], validation: Sequence[Record]
) -> Ladder:
    step = LadderStep(
        added=candidate,
        model=model,
        set=(candidate.name,),
        p_value=candidate.p_value,
        chosen_by="user",
        train=model_errors(model, records),
        validation=model_errors(model, validation),
    )
    return replace(ladder, steps=(*ladder.steps, step), verdict=MISSING)
