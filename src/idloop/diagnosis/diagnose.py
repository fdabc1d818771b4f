"""Which effect a model lacks, by the view in which the data show most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnosis.diagnosis import Diagnosis, diagnosis_of, findings_of_model
from idloop.diagnosis.evidence.deciding_view import DecidingView, requested_force_fit
from idloop.diagnosis.evidence.force_view import ForceView
from idloop.diagnosis.evidence.free_run_view import free_run_view
from idloop.diagnosis.evidence.prediction_view import PredictionView, delay_or_lag
from idloop.diagnosis.evidence.undetermined_strength import undetermined_strength
from idloop.diagnosis.model_errors import explains_less, runs_worse
from idloop.diagnosis.options import (
    FORCE,
    MINIMUM_IMPROVEMENT,
    PREDICTION,
    Options,
    Progress,
    diagnosis_problem,
    errors_of,
    held_out_problem,
    silent,
)
from idloop.diagnosis.search.step import NOISE_VERDICTS
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import common_scale, effect_scales
from idloop.physics.model import Model
from idloop.records import Record


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def diagnose(
    model: Model,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    level: float = 0.01,
    criterion: str = "auto",
    minimum_improvement: float = MINIMUM_IMPROVEMENT,
    effects: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the physical effect that a model lacks.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        Experiments; several amplitudes contain more information than one.
    validation : sequence of Record
        Held-out records: what does not reduce their errors as well is not named, as by `refine`.
    level : float
        Probability of naming an effect where none is missing, over the whole catalogue and all its pairs.
    criterion : {"auto", "prediction", "simulation", "force"}
        What the models are measured by, as in `idloop.estimation.fit`.
    minimum_improvement : float
        Part by which an effect must reduce the errors on unseen samples to be named.
    effects : sequence of str, optional
        Choose from these only (``name`` or ``name@site``).
    seed : int
        Of the sketches and restarts.
    progress : callable, optional
        Called with the share done and a text.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        Bad level or improvement, unknown effects, records that do not suit the model.
    """
    options = Options(level, minimum_improvement, effects, seed, progress or silent)
    options.report(0.0, "fitting the model as it is")
    kind = errors_of(criterion)
    scale = common_scale(CachingEngine(model), prepare(model, records))
    if scale is not None:
        model = scale.fixed(model)

    def by_errors() -> Diagnosis:
        estimation = diagnosis_problem(model, records, kind, validation)
        held_out = held_out_problem(estimation, model, validation, kind)
        view = PredictionView(estimation, model, options.within(0.5, 0.9), held_out)
        return _by_errors(view, refit(estimation, model))

    found = None
    if criterion in ("auto", FORCE):
        found = _by_force(model, records, validation, criterion, options.within(0.0, 0.3))
    if (
        criterion == "auto"
        and found is not None
        and (found.best is None or _grows(found.model, found, records, runs_worse))
    ):
        # A body that nobody measures moves an axis as no force balance shows; an axis that a loop holds drifts in free
        # run with any model, and what leaves more of the force is no better.
        other, reached = by_errors(), found.model if found.best is None else found.best.model
        worse = other.best is None or any(_grows(reached, other, records, by) for by in (explains_less, runs_worse))
        found = found if worse else other
    # Without a balance the free run is asked first, and after what leaves nothing else, as by `refine`.
    asked = criterion == "auto" and found is None
    if asked:
        found = _by_free_run(model, records, validation, options.within(0.3, 0.5))
    if found is None:
        found = by_errors()
    if criterion == "auto" and not asked and found.verdict in NOISE_VERDICTS and not found.response.uninformative:
        found = _by_free_run(found.model, records, validation, options.within(0.9, 1.0)) or found
    options.report(1.0, "done")
    reached = found.model if found.best is None or found.best.model is None else found.best.model
    undetermined = [] if scale is None else [scale]
    if found.best is not None:
        undetermined += effect_scales(reached, records)
    added = [rung.added.name for rung in found.rungs]
    findings = (*found.gate.findings, *findings_of_model(model, reached, added, found.response, undetermined))
    return replace(found, gate=replace(found.gate, findings=findings))


def _grows(
    before: Model | None,
    found: Diagnosis,
    records: Sequence[Record],
    by: Callable[[Model, Model, Sequence[Record]], bool],
) -> bool:
    """Whether an error is worse with the effect that a diagnosis names; False where either model is unknown."""
    after = None if found.best is None else found.best.model
    return before is not None and after is not None and by(before, after, records)


def _by_errors(view: PredictionView, fit: Refit) -> Diagnosis:
    """By one-step or free-run errors."""
    step = view.evaluate(fit)
    timed = view.with_timing(step) if step.tied else None
    return diagnosis_of(step if timed is None else timed[0].evaluate(timed[1]))


def _by_free_run(
    start: Model, records: Sequence[Record], validation: Sequence[Record], options: Options
) -> Diagnosis | None:
    """By free-run errors, where a free run is far off and an effect explains most of that; None else."""
    asked = free_run_view(start, records, validation, options)
    found = None if asked is None else _by_errors(*asked)
    return None if found is None or found.best is None else found


def _by_force(
    model: Model, records: Sequence[Record], validation: Sequence[Record], criterion: str, options: Options
) -> Diagnosis | None:
    """By the force balance; None where another view decides."""
    estimation, requested = diagnosis_problem(model, records, PREDICTION, validation), criterion == FORCE
    forms: dict[int, WeakForm] = {}
    deciding = None if requested else DecidingView(model, estimation, forms)
    fit = requested_force_fit(model, estimation, forms) if deciding is None else deciding.balance
    if fit is None:
        return None
    options.report(0.5, "evaluating effects")
    held_out = prepare(model, validation, companions=records) if validation else []
    step = ForceView(estimation, options, held_out, forms).evaluate(fit)
    shown = step.tied[0].fit if step.tied else fit if step.confounded else None
    if deciding is not None:
        if not (shown or fit).explains_force or (shown is None and not deciding.disturbance_absorbs_force):
            return None
        if step.tied and deciding.prediction_contradicts(step.tied[0].fit.model, options.level):
            return None
    found = diagnosis_of(step)
    if requested or found.best is None or found.pair is not None or found.best.model is None:
        return found
    separated = delay_or_lag(found.best.model, found.best.name, estimation, options)
    if separated:
        names = tuple(one.name for one in separated)
        others = (one for one in found.candidates if one.name not in names)
        return replace(found, candidates=(*separated, *others), set=names)
    if not step.tied:
        return found
    found = _with_predicted_values(found, step.tied[0].fit, estimation)
    return None if _within_disturbance(found) else found


def _within_disturbance(found: Diagnosis) -> bool:
    """Whether every effect that is named may be none by its values: a slow force no larger than the disturbance."""
    models = {one.name: one.model for one in found.candidates if one.name in found.set}
    return all(
        active.effect.slow and undetermined_strength(model, name, active.effect)
        for name, model in models.items()
        if model is not None
        for active in model.effects
        if active.name == name
    )


def _with_predicted_values(found: Diagnosis, fit: WeakFit, estimation: EstimationProblem) -> Diagnosis:
    """The same effects with values fitted to predictions, where these agree with the force balance."""
    if fit.model_error_dominates:
        return found
    candidates = []
    for one in found.candidates:
        predicted = (
            None if one.model is None or one.name not in found.set else refit_or_none(estimation, one.model, near=True)
        )
        # A balance that leaves next to nothing contradicts nothing, yet what leaves more of the force is no better.
        agrees = (
            predicted is not None
            and one.model is not None
            and not fit.contradicts(predicted.model)
            and not explains_less(one.model, predicted.model, estimation.records)
        )
        candidates.append(one.with_model(predicted.with_stderr()) if predicted is not None and agrees else one)
    return replace(found, candidates=tuple(candidates))
