"""Which effect a model lacks, by the view in which the data show most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnosis.diagnosis import Diagnosis, diagnosis_of, split_bodies
from idloop.diagnosis.evidence.deciding_view import NOTHING, Views, as_predicted, asked_fit
from idloop.diagnosis.evidence.force_view import ForceView
from idloop.diagnosis.evidence.prediction_view import PredictionView, delay_or_lag
from idloop.diagnosis.options import FORCE, MINIMUM_IMPROVEMENT, check_numbers, first_kind, with_common_whitening
from idloop.estimation.dataset import prepare
from idloop.estimation.direction import opposite_direction_warning
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.undetermined import common_scale, effect_scales
from idloop.physics.model import Model
from idloop.records import Record

Progress = Callable[[float, str], None]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def diagnose(
    model: Model,
    records: Sequence[Record],
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
        Experiments; several amplitudes tell more than one.
    level : float
        Probability of naming an effect where none is missing, over the whole catalogue and all its pairs.
    criterion : {"auto", "prediction", "simulation", "force"}
        What the models are measured by, as in `idloop.estimation.fit`.
    minimum_improvement : float
        Part by which an effect must make the errors on unseen samples smaller to be named.
    effects : sequence of str, optional
        Choose from these only (``name`` or ``name@site``).
    seed : int
        Of the calibration.
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
    check_numbers(level, minimum_improvement)
    tell = progress or (lambda share, text: None)
    tell(0.0, "fitting the model as it is")
    kind = first_kind(criterion)
    together = common_scale(CachingEngine(model), prepare(model, records))
    if together is not None:
        model = together.fixed(model)
    found = None
    if criterion in ("auto", FORCE):
        found = _by_force(model, records, criterion, level, minimum_improvement, effects, seed, tell)
    diagnosis = found or _by_errors(model, records, kind, level, minimum_improvement, effects, seed, tell)
    reached = diagnosis.model if diagnosis.best is None or diagnosis.best.model is None else diagnosis.best.model
    told = [] if together is None else [together]
    if diagnosis.best is not None and diagnosis.best.model is not None:
        told += effect_scales(diagnosis.best.model, records)
    texts = [
        "" if diagnosis.response.tells_nothing else opposite_direction_warning(model, reached),
        *(one.text for one in told),
        *split_bodies(reached, [rung.added.name for rung in diagnosis.rungs]),
    ]
    findings = (*diagnosis.gate.findings, *(text for text in texts if text))
    return replace(diagnosis, gate=replace(diagnosis.gate, findings=findings))


def _by_force(
    model: Model,
    records: Sequence[Record],
    criterion: str,
    level: float,
    least: float,
    effects: Sequence[str] | None,
    seed: int,
    tell: Progress,
) -> Diagnosis | None:
    """By the force balance; None where another view is to decide."""
    estimation, asked = with_common_whitening(prepare_estimation(model, records, "prediction")), criterion == FORCE
    forms: dict[int, WeakForm] = {}
    views = None if asked else Views(model, estimation, forms)
    fit = asked_fit(model, estimation, forms) if views is None else views.balance
    if fit is None:
        return None
    tell(0.3, "weighing effects")
    step = ForceView(estimation, level, least, effects, forms=forms).weigh(fit)
    shown = step.tied[0].fit if step.tied else fit if step.stand_ins else None
    if views is not None and ((shown is None and not views.blind) or (shown or fit).relative >= NOTHING):
        return None
    if views is not None and step.tied and views.contradict(step.tied[0].fit.model, level):
        return None
    found = diagnosis_of(step)
    if not asked and found.best is not None and found.pair is None and found.best.model is not None:
        told = delay_or_lag(found.best.model, found.best.name, estimation, level, seed)
        if told:
            names = tuple(one.name for one in told)
            found = replace(found, candidates=(*told, *(c for c in found.candidates if c.name not in names)), set=names)
        elif step.tied:
            found = _valued(found, step.tied[0].fit, estimation)
    tell(1.0, "done")
    return found


def _valued(found: Diagnosis, fit: WeakFit, estimation: EstimationProblem) -> Diagnosis:
    """The same effects with the values that `fit` gives them: of predictions, where these are the finer ones."""
    if fit.model_error_dominates:
        return found
    candidates = []
    for one in found.candidates:
        predicted = (
            None if one.model is None or one.name not in found.set else refit_or_none(estimation, one.model, near=True)
        )
        finer = predicted is not None and not fit.contradicts(predicted.model)
        candidates.append(as_predicted(one, predicted, estimation.records) if predicted is not None and finer else one)
    return replace(found, candidates=tuple(candidates))


def _by_errors(
    model: Model,
    records: Sequence[Record],
    kind: str,
    level: float,
    least: float,
    effects: Sequence[str] | None,
    seed: int,
    tell: Progress,
) -> Diagnosis:
    """By one-step or free-run errors."""
    estimation = with_common_whitening(prepare_estimation(model, records, kind))
    view = PredictionView(estimation, model, level, least, effects, seed=seed, tell=tell)
    found = diagnosis_of(view.weigh(refit(estimation, model)))
    tell(1.0, "done")
    return found
