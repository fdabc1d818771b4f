"""Runs of a model on one record: free run, predictions and drive force, without any measure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.dataset import Data, force_scale, output_noise, prepare
from idloop.estimation.likelihood.disturbance import SUBSET_SAMPLES, fit_random_walk
from idloop.estimation.observer.innovations import WALK, InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Model
from idloop.records import Record
from idloop.validation.drive import ForceError, force_error
from idloop.validation.free_run import free_run

# An observer that takes more of a record than this to settle is used from the first sample on.
_SETTLING_SHARE = 0.05


@dataclass(frozen=True)
class Runs:
    """Outputs and drive force of a model on one record; costly parts are computed at first use."""

    model: Model
    record: Record
    steps: int = 10  # prediction horizon of `ahead` in samples
    cutoff: float | None = None  # cut-off of the differentiating filter on the drive side [Hz]; from the data when None

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
        return self._observer.innovation(self.model.theta, self._observer.nuisance()[0], 0)

    @property
    def settled(self) -> int:
        """First sample at which the observer has settled; 0 when that takes more than a small part of the record."""
        if self._observer is None:
            return 0
        steps = self._observer.observer(self._observer.nuisance()[0], 0).steps
        return steps if steps <= _SETTLING_SHARE * len(self.data.time) else 0

    @cached_property
    def ahead(self) -> Array:
        """Prediction `steps` samples ahead, shape (n, p); NaN for the first `steps` samples and without an observer."""
        rule, theta = self._observer, self.model.theta
        if rule is None:
            return np.full(self.measured.shape, np.nan)
        start = rule.initial.state(rule.initial.values, 0, theta)
        d, observer = self.data, rule.observer(rule.nuisance()[0], 0)
        gains = observer.gains.reshape(-1, d.output.shape[1])
        return self._engine.predict_ahead(
            theta, d.input_time, d.input, d.time, d.output, gains, self.steps, start, observer.place, d.conditions
        )

    @property
    def force(self) -> ForceError | None:
        """Drive side; None when a body is not measured at a steady rate."""
        return self._force[0]

    @property
    def no_force(self) -> str:
        """Reason why there is no drive side; empty where there is one."""
        return self._force[1]

    @cached_property
    def _force(self) -> tuple[ForceError | None, str]:
        try:
            return force_error(self.model, self.record, self.cutoff), ""
        except InputError as error:
            return None, str(error)

    @cached_property
    def _engine(self) -> CachingEngine:
        return CachingEngine(self.model)

    @cached_property
    def _observer(self) -> InnovationCriterion | None:
        """The tuned observer; None where no linear observer exists, as with a sensor that measures a magnitude."""
        theta, known = self.model.theta, self.model.disturbance
        noise, force = output_noise(self.model, [self.data]), force_scale(self._engine, [self.data])
        rule = InnovationCriterion(self._engine, [self.data], noise, force)
        if known is not None and known > 0.0:
            exponent = float(np.log10(known**2 / rule.unit))
        else:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    exponent = fit_random_walk(rule.subset(SUBSET_SAMPLES) or rule, theta, whiten=False)
            except IdloopError:
                return None
        rule.retune(theta)
        rule.keep(np.array([exponent, WALK]))
        return rule
