"""Which view decides what a model lacks: its force balance, or predictions of the next sample."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from idloop.diagnosis.evidence.undetermined_strength import CERTAIN
from idloop.errors import InputError
from idloop.estimation.force_balance.weak_fit import WeakFit, draft_windows, fit_from_two_starts
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model

# The command is reversed where that reduces the unexplained force to less than this part.
_REVERSED = 0.5
# Samples at the beginning of the records by which predictions are compared first.
_FIRST_SAMPLES = 4000


class DecidingView:
    """The force balance of a model beside predictions of the next sample.

    `balance` is None where it cannot decide: some body is not measured, sensor noise dominates, a gain scales all
    forces, or the command is reversed. New windows are added to `forms`.
    """

    def __init__(self, model: Model, estimation: EstimationProblem, forms: dict[int, WeakForm]) -> None:
        self.model, self.estimation = model, estimation
        fit = fit_by_force(CachingEngine(model), estimation.data, model.theta, forms)
        serves = (
            fit is not None
            and fit.usable
            and not fit.scaled_by_loop
            and (fit.explains_force or estimation.resolves(_with_largest_inertias(fit)))
            and not _command_is_reversed(fit)
        )
        self.balance = fit if serves else None

    @cached_property
    def predicted(self) -> Refit | None:
        """The model fitted to prediction errors; None where it cannot be."""
        return refit_or_none(self.estimation, self.model)

    @cached_property
    def _first_part(self) -> tuple[EstimationProblem, Refit | None] | None:
        """The first part of long records, and the model fitted to its prediction errors; None for short ones."""
        part = _beginning_of(self.estimation, self.model)
        return None if part is None else (part, refit_or_none(part, self.model))

    @cached_property
    def disturbance_absorbs_force(self) -> bool:
        """Whether predictions attribute to a disturbance what the force balance shows to be a force."""
        if self.balance is None:
            return False
        predicted = self.predicted if self._first_part is None else self._first_part[1]
        return predicted is None or self.balance.contradicts(predicted.model)

    @property
    def consistent_prediction(self) -> Refit | None:
        """The model fitted to prediction errors, where that agrees with the force balance; else None."""
        balance = self.balance
        if balance is None:
            return self.predicted
        # Where model error dominates, predictions are not computed: they may take minutes.
        return None if balance.model_error_dominates or self.disturbance_absorbs_force else self.predicted

    def prediction_contradicts(self, found: Model, level: float) -> bool:
        """Whether predictions of the next sample are no better with what the force balance has found.

        Where a disturbance moves an axis in a closed loop, the balance shows the controller and not the axis, and
        predictions show the disturbance. Predictions whose disturbance absorbs the force contradict nothing.
        """
        if self.disturbance_absorbs_force:
            return False
        # The first part is mostly enough.
        if self._first_part is not None and not _no_better(self._first_part[1], found, self._first_part[0], level):
            return False
        return _no_better(self.predicted, found, self.estimation, level)


def _with_largest_inertias(fit: WeakFit) -> Model:
    """The fitted model with every inertia at the upper end of its interval.

    A force that is still missing makes an inertia uncertain and a drag too large: a machine, not one without inertia.
    """
    free, values = fit.form.engine.free, dict(fit.model.values)
    errors = np.sqrt(np.diag(fit.covariance))[: len(free)]
    for body in fit.model.bodies:
        name = f"{body}.inertia"
        if name in free and np.isfinite(error := errors[free.index(name)]):
            values[name] += CERTAIN * float(error)
    return fit.model.with_values(values)


def requested_force_fit(model: Model, estimation: EstimationProblem, forms: dict[int, WeakForm]) -> WeakFit:
    """The model fitted by its force balance at the user's request; an `InputError` where it cannot be evaluated."""
    fit = fit_by_force(CachingEngine(model), estimation.data, model.theta, forms, accept_noise=True)
    if fit is None:
        raise InputError(
            "the force criterion needs every body's position or velocity at a steady rate, and some hundred samples",
            "use prediction",
        )
    return fit


def _beginning_of(estimation: EstimationProblem, start: Model) -> EstimationProblem | None:
    """The first part of the records as a problem; None where they are short, or begin without a motion."""
    samples = sum(len(record.time) for record in estimation.records)
    if samples < 2 * _FIRST_SAMPLES:
        return None
    ends = [record.time[(len(record.time) - 1) * _FIRST_SAMPLES // samples] for record in estimation.records]
    try:
        cut = [record.cut(None, float(end)) for record, end in zip(estimation.records, ends, strict=True)]
        return prepare_estimation(start, cut, estimation.kind)
    except InputError:
        return None


def _no_better(plain: Refit | None, found: Model, estimation: EstimationProblem, level: float) -> bool:
    if plain is None:
        return False
    if plain.many_lags:
        # Noise with a long memory takes model error for noise: it contradicts only values that make predictions worse.
        own = (name for name in plain.model.free if name in found.free)
        held = refit_or_none(estimation, found.with_free(own), near=True)
        if held is None or plain.log_likelihood - held.log_likelihood < math.log(1.0 / level):
            return False
    # What the last effects make faster than the samples is compared without these.
    while not estimation.evaluates(found) and len(found.effects) > len(plain.model.effects):
        found = found.without_effect(found.effects[-1].name)
    # One search from the values of the balance is mostly enough.
    for near in (True, False):
        after = refit_or_none(estimation, found, near=near)
        if after is not None and after.log_likelihood - plain.log_likelihood >= math.log(1.0 / level):
            return False
    return after is not None and len(found.effects) > len(plain.model.effects)


def _command_is_reversed(fit: WeakFit) -> bool:
    """Whether the model explains far more of the force with the sign of the command reversed."""
    return (
        fit_from_two_starts(draft_windows(fit.form).with_reversed_command(), fit.point).relative
        < _REVERSED * fit.relative
    )
