"""Climb the ladder: diagnose, add, refit, until nothing significant is left."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.diagnosis.candidate import Candidate, effect_parameters
from idloop.diagnosis.diagnosis import candidate_of, findings_of_model
from idloop.diagnosis.evidence.deciding_view import DecidingView, requested_force_fit
from idloop.diagnosis.evidence.force_view import ADEQUATE_FORCE, ForceView, fitted_model
from idloop.diagnosis.evidence.free_run_view import free_run_view
from idloop.diagnosis.evidence.prediction_view import PredictionView, delay_or_lag
from idloop.diagnosis.evidence.quantisation import quantised_outputs
from idloop.diagnosis.evidence.undetermined_strength import CERTAIN, undetermined_strength
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.model_errors import explains_less, runs_worse
from idloop.diagnosis.options import (
    FORCE,
    MINIMUM_IMPROVEMENT,
    PREDICTION,
    SIMULATION,
    Options,
    Progress,
    diagnosis_problem,
    errors_of,
    held_out_problem,
    silent,
)
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search.climb import Climb
from idloop.diagnosis.search.step import ADEQUATE, MISSING, NOISE_VERDICTS, UNKNOWN, FitT, View
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.greybox import fit as fit_as_chosen
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import common_scale, effect_scales
from idloop.physics.effect_text import parse_effect
from idloop.physics.model import ActiveEffect, Model
from idloop.records import Record

# A balance that leaves more of the force than this has not shown what moves the axis.
_MOST_UNEXPLAINED = 0.5


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
    options = Options(level, minimum_improvement, effects, seed, progress or silent)
    kind = errors_of(criterion)
    start = model if ladder is None else ladder.model
    scale = common_scale(CachingEngine(start), prepare(start, records))
    if scale is not None:
        start = scale.fixed(start)
    task = _Refinement(model, records, validation, options, most, on_step)
    if criterion == "auto" and ladder is not None and ladder.criterion != "auto":
        # A ladder goes on by its own criterion.
        criterion = kind = ladder.criterion
    found, last = None, None
    if criterion in ("auto", FORCE):
        found, last = task.within(0.0, 0.5).by_force(start, ladder, requested=criterion == FORCE)
        if criterion != FORCE:
            # Without a balance the free run is asked first.
            found = found or (ladder if ladder is not None else task.within(0.5, 0.6).by_free_run(start, None))
            by_errors = task.within(0.6, 0.8).by_errors
            found = by_errors(start if found is None else found.model, found, PREDICTION, last)
            if last is not None:
                found = task.within(0.8, 0.9).checked_by_free_run(start, ladder, found, last)
    if found is None:
        found = task.within(0.0, 0.9).by_errors(start, ladder, kind)
    if criterion == "auto" and found.verdict in NOISE_VERDICTS and not found.response.uninformative:
        options.report(0.9, "comparing the free run")
        more = task.within(0.9, 0.95).by_free_run(found.model, found)
        if more is not found and more is not None:
            found = task.within(0.95, 1.0).by_errors(more.model, more, PREDICTION)
    if criterion == "auto" and ladder is None and found.criterion == PREDICTION:
        options.report(0.95, "fitting the free run")
        found = task.with_values_of_free_run(start, found)
    options.report(1.0, "done")
    undetermined = ([] if scale is None else [scale]) + effect_scales(found.model, records)
    findings = findings_of_model(start, found.model, found.added, found.response, undetermined)
    contradicted = filter(None, (free_run_finding(found), force_finding(found)))
    return replace(found, findings=(*found.findings, *findings, *contradicted))


def free_run_finding(ladder: Ladder) -> str:
    """Say that a model is adequate in one view and far off in free run; empty where it is not."""
    last = ladder.steps[-1]
    errors: Mapping[str, float] = (last.validation or last.train).get("nrmse", {})
    far = {name: share for name, share in errors.items() if not share < 1.0}
    if ladder.verdict != ADEQUATE or not far:
        return ""
    worst = max(far, key=lambda name: far[name] if math.isfinite(far[name]) else math.inf)
    error = f"is off by {100.0 * far[worst]:.3g} % of the signal" if math.isfinite(far[worst]) else "diverges"
    return (
        f"adequate by {ladder.criterion}, yet the free run of {worst} {error}: small errors of the force add up over a "
        "record, so use this model for forces and short predictions"
    )


def force_finding(ladder: Ladder) -> str:
    """Say that a model is adequate by its errors and leaves much of the force that is no noise; empty otherwise."""
    last = ladder.steps[-1]
    errors = last.validation or last.train
    left, noise = errors.get("force"), errors.get("force_noise") or 0.0
    if ladder.verdict != ADEQUATE or ladder.criterion == FORCE or left is None:
        return ""
    if math.sqrt(max(left**2 - noise**2, 0.0)) < ADEQUATE_FORCE:
        return ""
    return (
        f"adequate by {ladder.criterion}, yet {100.0 * left:.3g} % of the drive force stays unexplained: something is"
        " missing that no effect that was looked for explains, or the motion is measured with errors of that size"
    )


@dataclass(frozen=True)
class _Refinement:
    """What does not change while a ladder is refined; attributes as the parameters of `refine`."""

    model: Model
    records: Sequence[Record]
    validation: Sequence[Record]
    options: Options
    most: int
    on_step: Callable[[Ladder], None] | None

    def within(self, begin: float, end: float) -> _Refinement:
        """The same for a part of the work, from one share of the whole to another."""
        return replace(self, options=self.options.within(begin, end))

    def by_force(
        self, start: Model, ladder: Ladder | None, *, requested: bool
    ) -> tuple[Ladder, WeakFit] | tuple[Ladder | None, None]:
        """Climb by the force balance where it decides, to its last fit; the same ladder where it shows nothing."""
        estimation = diagnosis_problem(start, self.records, PREDICTION, self.validation)
        forms: dict[int, WeakForm] = {}
        deciding = None if requested else DecidingView(start, estimation, forms)
        fit = requested_force_fit(start, estimation, forms) if deciding is None else deciding.balance
        if deciding is not None and ladder is not None:
            # An interrupted ladder has the values of the force balance.
            ladder = self._as_predicted(ladder, -1, deciding.consistent_prediction)
        if fit is None:
            return ladder, None
        held_out = prepare(start, self.validation, companions=self.records) if self.validation else []
        found, last = self._climb(ForceView(estimation, self.options, held_out, forms), FORCE)(fit, ladder)
        if deciding is None:
            return found, last
        nothing = len(found.steps) == (1 if ladder is None else len(ladder.steps))
        if not last.explains_force or (
            not deciding.disturbance_absorbs_force
            if nothing
            else deciding.prediction_contradicts(found.model, self.options.level)
        ):
            return ladder, None
        return (found if ladder is not None else self._as_predicted(found, 0, deciding.consistent_prediction)), last

    def by_errors(self, start: Model, ladder: Ladder | None, kind: str, last: WeakFit | None = None) -> Ladder:
        """Climb by prediction or free-run errors, on from the last force fit, whose error must not grow."""
        estimation = diagnosis_problem(start, self.records, kind, self.validation)
        held_out = held_out_problem(estimation, start, self.validation, kind)
        view = PredictionView(estimation, self.model, self.options, held_out)
        if ladder is None or last is None:
            found, _ = self._climb(view, kind)(refit(estimation, start), ladder)
        else:
            found = self._beyond_force(view, self._with_delay_or_lag(estimation, ladder), last)
        for candidate in quantised_outputs(found.model, estimation, self.options.effects):
            if len(found.added) < self.most:
                found = _with_resolution(found, candidate)
        return found

    def checked_by_free_run(self, start: Model, ladder: Ladder | None, found: Ladder, last: WeakFit) -> Ladder:
        """The same ladder, or that of predictions where its free run is worse than without its effects.

        Or where the balance leaves most of the force and they split a body: one that nobody measures moves an axis as
        no force balance shows. Where a loop holds the axis, an open run drifts with any model, and what leaves more of
        the force is no better.
        """
        runs_worse = bool(found.added) and self._runs_worse(found.steps[0].model, found.model)
        unbalanced = last.relative > _MOST_UNEXPLAINED and not found.model.inner_couplings
        if not (runs_worse or unbalanced):
            return found
        # What was found is kept until then.
        other = replace(self, on_step=None).by_errors(start, ladder, PREDICTION)
        if not other.added or not (runs_worse or other.model.inner_couplings):
            return found
        worse = any(check(found.model, other.model) for check in (self._worse, self._runs_worse))
        return found if worse else other

    def by_free_run(self, start: Model, ladder: Ladder | None) -> Ladder | None:
        """Climb by free-run errors where a free run is far off; the same ladder where they show nothing."""
        asked = free_run_view(start, self.records, self.validation, self.options, near=ladder is not None)
        if asked is None:
            return ladder
        view, fit = asked
        # It was evaluated in some of the samples, from starts of their own.
        found, _ = replace(self._climb(view, SIMULATION), worse=self._runs_worse)(fit, ladder)
        return found if found.added != (() if ladder is None else ladder.added) else ladder

    def _beyond_force(self, view: PredictionView, ladder: Ladder, last: WeakFit) -> Ladder:
        """Climb on by predictions from what the force balance has found."""
        fit = refit_or_none(view.estimation, ladder.model, near=True)
        if fit is not None and not fit.many_lags:
            fit = refit_or_none(view.estimation, ladder.model)
        # Where a disturbance absorbs a part of the force, predictions show no more than the balance.
        if fit is None or (self._worse(ladder.model, fit.model) if ladder.added else last.contradicts(fit.model)):
            return ladder
        agrees = not (last.model_error_dominates or last.contradicts(fit.model))
        # A balance along a body that stands for half of the time may be wrong, which the held-out records show.
        refuted = self._held_out_is_worse(fit.model, ladder.model)
        if agrees or refuted:
            ladder, fit = self._without_unseen(ladder, view.estimation, fit)
            ladder = self._as_predicted(ladder, -1, fit)
        # Predictions would take for noise what the balance leaves beyond its noise: they evaluate only what the balance
        # cannot show. Where they need no whitening they are the more sensitive view.
        balanced = last.usable and any(fit.problem.orders) and not refuted
        view = view.beside(ladder.model, balanced=balanced)
        if view.choices(ladder.model) == []:
            return ladder
        more, _ = replace(self._climb(view, PREDICTION), reduces=True)(fit, ladder)
        return ladder.merged_with(more) if balanced and more.added == ladder.added else more

    def _held_out_is_worse(self, before: Model, after: Model) -> bool:
        """Whether both the force error and the free run of the held-out records are worse with the second model."""
        return bool(self.validation) and all(
            worse(before, after, self.validation) for worse in (explains_less, runs_worse)
        )

    def _without_unseen(self, ladder: Ladder, estimation: EstimationProblem, fit: Refit) -> tuple[Ladder, Refit]:
        """The ladder without effects that predictions, more precise than the balance, do not see.

        Nor slow forces that may be the disturbance.
        """
        found = {step.added.name for step in ladder.steps if step.added is not None and step.chosen_by == "diagnosis"}
        predicted = {one.name: one for one in fit.with_stderr().parameters}
        balanced = {one.name: one for one in ladder.model.parameters}
        names = []
        for active in ladder.model.effects:
            strength = active.effect.strength
            if active.name not in found or not strength:
                continue
            seen, before = predicted[f"{active.name}.{strength}"], balanced[f"{active.name}.{strength}"]
            error, moved = seen.stderr or math.inf, abs(seen.value - active.effect.spec(strength).neutral)
            precise = active.effect.slow or error < (before.stderr or 0.0)
            if precise and moved < CERTAIN * error:
                names.append(active.name)
        without = refit_or_none(estimation, fit.model.without_effects(names), None, fit) if names else None
        if without is None or self._worse(ladder.model, without.model):
            return ladder, fit
        left = tuple(one for one in ladder.steps if one.added is None or one.added.name not in names)
        return replace(ladder, steps=left), without

    def _climb(self, view: View[FitT], criterion: str) -> Climb[FitT]:
        options = self.options
        return Climb(
            view, self.records, self.validation, criterion, options.level, self.most, options.report, self.on_step,
            worse=None if criterion == SIMULATION else self._worse,
        )  # fmt: skip

    def _as_predicted(self, ladder: Ladder, place: int, fit: Refit | None) -> Ladder:
        """The ladder with the model of a step fitted to prediction errors; unchanged without a fit."""
        if fit is None:
            return ladder
        steps = list(ladder.steps)
        added = steps[place].added
        added = None if added is None else added.with_model(fit.with_stderr())
        model = fit.with_stderr() if added is None or added.model is None else added.model
        steps[place] = replace(steps[place], added=added).measured(model, self.records, self.validation)
        return replace(ladder, steps=tuple(steps))

    def with_values_of_free_run(self, start: Model, ladder: Ladder) -> Ladder:
        """The ladder whose first and last model have the values of a free run, where a fit of them takes these.

        The last one keeps those of predictions where its free run of the held-out records is worse with the others.
        What they do not determine, and what then explains less than the first, is not added.
        """
        last, reason = len(ladder.steps) - 1, ""
        for place, model in {0: start, last: ladder.model if last else start}.items():
            found = fit_as_chosen(model, self.records)
            if found.criterion != SIMULATION:
                continue
            if place and self.validation and runs_worse(ladder.steps[place].model, found.model, self.validation):
                continue
            if place and (undetermined := _undetermined_steps(ladder, found.model)):
                return self.with_values_of_free_run(start, _without_steps(ladder, undetermined))
            step = ladder.steps[place].measured(found.model, self.records, self.validation)
            if place and step.added is not None:
                step = replace(step, added=step.added.with_model(found.model))
            ladder = replace(ladder, steps=(*ladder.steps[:place], step, *ladder.steps[place + 1 :]))
            reason = f"the values are those of a free run, not of one-step predictions: {found.why}"
        if reason and ladder.added and self._worse(ladder.steps[0].model, ladder.model):
            refused = (
                f"one step ahead {' and '.join(ladder.added)} would help; with the values of a free run the model"
                " explains less of the records, so that nothing is added: something else is missing"
            )
            # What is said of their values goes with them; that they were looked for stays.
            findings = (text for text in ladder.findings if not any(name in text for name in ladder.added))
            known = {one.name for one in ladder.candidates}
            looked_for = (one.added for one in ladder.steps if one.added is not None and one.added.name not in known)
            return replace(
                ladder, steps=ladder.steps[:1], verdict=UNKNOWN, findings=(*findings, reason, refused),
                candidates=(*ladder.candidates, *looked_for),
            )  # fmt: skip
        return replace(ladder, findings=(*ladder.findings, *([reason] if reason else [])))

    def _with_delay_or_lag(self, estimation: EstimationProblem, ladder: Ladder) -> Ladder:
        """The ladder with a delay or a lag of the drive as predictions separate them."""
        for step in ladder.steps[1:]:
            if step.added is None or step.chosen_by == "user":
                continue
            separated = delay_or_lag(ladder.model, step.added.name, estimation, self.options)
            model = separated[0].model if separated else None
            if model is None or self._worse(ladder.model, model):
                continue
            best, names = separated[0], tuple(one.name for one in separated)
            other = replace(step, added=best, set=names, p_value=best.p_value)
            other = other.measured(model, self.records, self.validation)
            ladder = replace(ladder, steps=(*(one for one in ladder.steps if one is not step), other))
        return ladder

    def _runs_worse(self, before: Model, after: Model) -> bool:
        return any(runs_worse(before, after, some) for some in (self.records, self.validation) if some)

    def _worse(self, before: Model, after: Model) -> bool:
        return explains_less(before, after, self.validation or self.records)


def _undetermined_steps(ladder: Ladder, fitted: Model) -> dict[str, str]:
    """Effects that a diagnosis has added and that the values of a free run do not determine, and why."""
    effects = {active.name: active.effect for active in fitted.effects}
    found = {
        step.added.name: undetermined_strength(fitted, step.added.name, effects[step.added.name])
        for step in ladder.steps
        if step.added is not None and step.chosen_by == "diagnosis" and step.added.name in effects
    }
    return {name: f"the data do not determine its {own} in a free run" for name, own in found.items() if own}


def _without_steps(ladder: Ladder, refused: Mapping[str, str]) -> Ladder:
    """The ladder without some of its effects, and why they are not added."""
    left = [
        replace(step, model=step.model.without_effects(set(refused) & set(step.model.effect_names)))
        for step in ladder.steps
        if step.added is None or step.added.name not in refused
    ]
    findings = tuple(text for text in ladder.findings if not any(name in text for name in refused))
    return replace(ladder, steps=tuple(left), findings=findings, passed_over={**ladder.passed_over, **refused})


def _with_resolution(ladder: Ladder, candidate: Candidate) -> Ladder:
    """The ladder with a sensor's resolution, which changes no other parameter and no free run."""
    values = {name: entry["value"] for name, entry in candidate.parameters.items()}
    model = ladder.model.with_entry(candidate.effect, candidate.at, values)
    added = replace(candidate, model=model)
    step = replace(ladder.steps[-1], added=added, model=model, set=(added.name,), p_value=added.p_value)
    return replace(ladder, steps=(*ladder.steps, replace(step, chosen_by="diagnosis")))


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
    options = Options(ladder.level, 0.0, [f"{name}@{at}"], seed)
    (progress or silent)(0.0, f"refitting with {name}@{at}")
    criterion = criterion or ladder.criterion

    def extended() -> Model:
        return ladder.model.with_effect(name, at, **values)

    if criterion == FORCE:
        candidate = _added_by_force(ladder.model, extended, not values, records, validation, options)
    else:
        candidate = _added_by_errors(ladder.model, extended(), not values, records, errors_of(criterion), options)
    step = Step(candidate, ladder.model, (candidate.name,), candidate.p_value, "user")
    step = step.measured(candidate.model or ladder.model, records, validation)
    return replace(ladder, steps=(*ladder.steps, step), verdict=MISSING)


def _added_by_errors(
    model: Model, extended: Model, searched: bool, records: Sequence[Record], kind: str, options: Options
) -> Candidate:
    """The user's choice fitted to prediction or free-run errors; `searched` from what the screening promises."""
    estimation = diagnosis_problem(model, records, kind)
    parent = refit(estimation, model)
    wanted = extended.effects[-1].name
    if searched and any(one.name == wanted for one in proposals(parent.model, None, estimation.conditions)):
        step = PredictionView(estimation, model, options).evaluate(parent)
        for found in step.evaluated[:1]:
            return candidate_of(step, found, 0, step.reported(found.fit))
    fit = refit(estimation, extended, None, parent)
    return _chosen(extended.effects[-1], fit.with_stderr(), fit.log_likelihood - parent.log_likelihood)


def _added_by_force(
    model: Model,
    extended: Callable[[], Model],
    searched: bool,
    records: Sequence[Record],
    validation: Sequence[Record],
    options: Options,
) -> Candidate:
    """The user's choice fitted by the force balance; `searched` from what the unexplained force promises."""
    estimation = prepare_estimation(model, records, PREDICTION, validation)
    parent = requested_force_fit(model, estimation, {})
    found = ForceView(estimation, options).best_fit(parent) if searched else None
    fit = requested_force_fit(extended() if found is None else found.model, estimation, {})
    return _chosen(fit.model.effects[-1], fitted_model(fit), fit.log_likelihood - parent.log_likelihood)


def _chosen(active: ActiveEffect, fitted: Model, gain: float) -> Candidate:
    return Candidate(
        effect=active.effect.name,
        at=active.at,
        testable="yes",
        why="chosen by the user",
        text=active.effect.text,
        gain=gain,
        parameters=effect_parameters(fitted, active.name),
        model=fitted,
        number=active.number,
    )
