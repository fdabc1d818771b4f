"""What a model does on one record: free run, prediction and drive side, before anything is said about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError, InputError
from idloop.estimation.dataset import Data, force_scale, openings, output_noise, prepare
from idloop.estimation.optimisation.smooth_engine import RememberingEngine
from idloop.estimation.prediction import PredictionCriterion
from idloop.validation.ahead import steps_ahead
from idloop.validation.drive import ForceError, force_error
from idloop.validation.free_run import free_run

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Runs:
    """A model's outputs and drive force on one record. Parts that cost time are computed when first asked for.

    Attributes
    ----------
    model : Model
    record : Record
    steps : int
        Steps ahead of `ahead`.
    cutoff : float or None
        Cut-off of the differentiating filter on the drive side [Hz]; from the data when None.
    """

    model: Model
    record: Record
    steps: int = 10
    cutoff: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Output names."""
        return tuple(o.name for o in self.model.outputs)

    @property
    def time(self) -> Array:
        """Instants [s], shape (n,)."""
        return self.record.time

    @property
    def measured(self) -> Array:
        """Measured output, shape (n, p)."""
        return self.record.output

    @cached_property
    def data(self) -> Data:
        """The record as the compiled simulator reads it."""
        return prepare(self.model, [self.record])[0]

    @cached_property
    def simulated(self) -> Array:
        """Free run from an estimated initial state, shape (n, p); NaN when it does not stay finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                return free_run(self._engine, self.data)
            except IdloopError:
                return np.full(self.measured.shape, np.nan)

    @cached_property
    def predicted(self) -> Array:
        """One-step prediction, shape (n, p)."""
        return self.measured - self.innovation

    @cached_property
    def innovation(self) -> Array:
        """One-step prediction error, shape (n, p); NaN where not measured and without an observer."""
        if self._observer is None:
            return np.full(self.measured.shape, np.nan)
        theta, nuisance = self.model.theta, self._observer.nuisance()[0]
        return self._observer.innovation(theta, nuisance, 0)

    @property
    def settled(self) -> int:
        """First sample at which the predictions no longer depend on where the observer started."""
        rule = self._observer
        return 0 if rule is None or rule.estimate_start else int(np.ceil(rule.observer.memory))

    @cached_property
    def ahead(self) -> Array:
        """Prediction `steps` samples ahead, shape (n, p); NaN for the first `steps` samples and without an observer."""
        rule, theta = self._observer, self.model.theta
        if rule is None:
            return np.full(self.measured.shape, np.nan)
        start = rule.initial.state(rule.initial.values, 0, theta)
        return steps_ahead(self._engine, self.data, rule.observer.gain, self.steps, start)

    @property
    def force(self) -> ForceError | None:
        """Drive side, or None when some body is not measured steadily."""
        return self._force[0]

    @property
    def no_force(self) -> str:
        """Why there is no drive side; empty where there is one."""
        return self._force[1]

    @cached_property
    def _force(self) -> tuple[ForceError | None, str]:
        try:
            return force_error(self.model, self.record, self.cutoff), ""
        except InputError as error:
            return None, str(error)

    @cached_property
    def _engine(self) -> RememberingEngine:
        return RememberingEngine(self.model)

    @cached_property
    def _observer(self) -> PredictionCriterion | None:
        """The tuned predictor; None where no linear gain follows the model, as with a sensor blind to the sign."""
        data = [self.data]
        theta, given = self.model.theta, (output_noise(self.model, data), force_scale(self._engine, data))
        known = self.model.disturbance
        if known is not None and known > 0.0:
            rule = PredictionCriterion(self._engine, data, *given)
            rule.fix(theta, known**2)
            return rule
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                short, near = openings(data), None
                if short is not None:
                    begin = PredictionCriterion(self._engine, short, *given)
                    begin.retune(theta)
                    near = begin.intensity
                rule = PredictionCriterion(self._engine, data, *given, near)
                rule.retune(theta)
        except IdloopError:
            return None
        return rule
