"""Whether the force balance of a model serves, and may decide what it lacks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

from idloop.diagnosis.candidate import Candidate, effect_parameters
from idloop.errors import InputError
from idloop.estimation.force_balance.weak_fit import WeakFit, draft_windows, fit_by_force, fit_from_two_starts
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model
from idloop.records import Record

# Where the best model leaves this part of the drive's force, it is not the force that moves the axis.
NOTHING = 0.9
# With the command turned a model explains far more where it leaves less than this part of what it leaves otherwise.
_FAR_LESS = 0.5
# Windows that leave out more of the motion than so many times the sensors' noise leave out forces.
_LEFT_OUT = 3.0
# Samples that mostly tell whether predictions are better with an effect that the force balance shows.
_BEGINNINGS = 4000


class Views:
    """The force balance of a model beside predictions of the next sample: which of them decides what it lacks.

    `balance` is None where it cannot decide: where some body is not measured, where sensor noise is what it would show,
    where it leaves next to nothing, where windows that are wide enough for that leave out much of the motion, where the
    command is turned, and where what it shows is a feedback. Windows that are made anew are added to `forms`.
    """

    def __init__(self, model: Model, estimation: EstimationProblem, forms: dict[int, WeakForm]) -> None:
        self.model, self.estimation = model, estimation
        fit = fit_by_force(CachingEngine(model), estimation.data, model.theta, forms)
        serves = (
            fit is not None
            and fit.usable
            and fit.form.left_out <= _LEFT_OUT
            and estimation.resolves(fit.model)
            and not _against_the_command(fit)
        )
        self.balance = fit if serves else None

    @cached_property
    def predicted(self) -> Refit | None:
        """The model fitted to prediction errors; None where it cannot be."""
        return refit_or_none(self.estimation, self.model)

    @cached_property
    def _begun(self) -> tuple[EstimationProblem, Refit | None] | None:
        """How long records begin, and the model fitted to that by prediction errors; None where they are short."""
        part = _beginnings(self.estimation, self.model)
        return None if part is None else (part, refit_or_none(part, self.model))

    @cached_property
    def blind(self) -> bool:
        """Whether predictions take for a disturbance what the balance shows to be a force."""
        if self.balance is None:
            return False
        predicted = self.predicted if self._begun is None else self._begun[1]
        return predicted is None or self.balance.contradicts(predicted.model)

    @property
    def finer(self) -> Refit | None:
        """The model fitted to prediction errors where its values are those of `fit`; None where they are not."""
        balance = self.balance
        if balance is None:
            return self.predicted
        # Where model error rules, predictions are not asked: they may take minutes.
        return None if balance.model_error_dominates or self.blind else self.predicted

    def contradict(self, found: Model, level: float) -> bool:
        """Whether predictions of the next sample are no better for what the balance has found.

        Where a disturbance moves an axis and a loop answers it, the balance shows that loop and not the axis.
        Predictions have the disturbance for what it is; those that are blind contradict nothing.
        """
        if self.blind:
            return False
        # How long records begin mostly says enough; where it does not, all of them are asked.
        if self._begun is not None and not _denies(self._begun[1], found, self._begun[0], level):
            return False
        return _denies(self.predicted, found, self.estimation, level)


def as_predicted(candidate: Candidate, fit: Refit, records: Sequence[Record]) -> Candidate:
    """A candidate with the values of a fit to prediction errors, of the model that has it."""
    model = fit.with_stderr()
    return replace(candidate, model=model, parameters=effect_parameters(model, candidate.name))


def asked_fit(model: Model, estimation: EstimationProblem, forms: dict[int, WeakForm]) -> WeakFit:
    """The model fitted by its force balance, which was asked for: it decides wherever it can be evaluated.

    Raises `InputError` where it cannot be.
    """
    fit = fit_by_force(CachingEngine(model), estimation.data, model.theta, forms, accept_noise=True)
    if fit is None:
        raise InputError(
            "the force criterion needs every body's position or velocity at a steady rate, and some hundred samples; "
            "use prediction"
        )
    return fit


def _beginnings(estimation: EstimationProblem, start: Model) -> EstimationProblem | None:
    """How the records begin, as a problem of its own; None where they are short, or begin without a motion."""
    samples = sum(len(record.time) for record in estimation.records)
    if samples < 2 * _BEGINNINGS:
        return None
    ends = [record.time[(len(record.time) - 1) * _BEGINNINGS // samples] for record in estimation.records]
    try:
        cut = [record.cut(None, float(end)) for record, end in zip(estimation.records, ends, strict=True)]
        return prepare_estimation(start, cut, estimation.kind)
    except InputError:
        return None


def _denies(plain: Refit | None, found: Model, estimation: EstimationProblem, level: float) -> bool:
    if plain is None:
        return False
    # One search from the values of the balance mostly shows that predictions are better for it.
    for near in (True, False):
        after = refit_or_none(estimation, found, near=near)
        if after is not None and after.log_likelihood - plain.log_likelihood >= math.log(1.0 / level):
            return False
    return after is not None


def _against_the_command(fit: WeakFit) -> bool:
    """Whether the same model explains far more of the force with the sign of the command turned."""
    return (
        fit_from_two_starts(draft_windows(fit.form).with_reversed_command(), fit.point).relative
        < _FAR_LESS * fit.relative
    )
