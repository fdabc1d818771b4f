"""Errors of a rival as the force that it leaves unexplained.

On a machine that is measured well, model error and not sensor noise limits what can be decided. An observer would
explain whatever a rival misses as a disturbance; the force balance along the motion does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.rival_noise import Whitening
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_fit import model_error_dominates
from idloop.estimation.force_balance.weak_form import NARROWEST, WeakForm, weak_form
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.optimisation.caching_engine import CachingEngine

if TYPE_CHECKING:
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Times from the stamp of a command to its action that are tried, in samples.
_SHIFTS = np.linspace(-1.0, 2.0, 13)


class ForceErrors:
    """Unexplained force of one rival; `form` is the force balance on the data so far."""

    period = 1
    # No disturbance is assumed.
    stronger: tuple[float, ...] = ()

    def __init__(self, model: Model, form: WeakForm, sample_time: float) -> None:
        self.model, self._sample_time = model, sample_time
        self.engine = CachingEngine(model)
        self._form = form.with_engine(self.engine)
        self._shift = _best_shift(self._form, model.theta)
        errors = self._by_record(model.theta)
        self._own = self._common = Whitening.of(errors)
        self._spread = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0))
        self._seen: tuple[int, WeakForm] | None = None

    @property
    def size(self) -> float:
        """Logarithm of the size of the errors on the data so far."""
        return -float(np.sum(np.log(np.diag(self._own.weight))))

    def scaled_as(self, other: ForceErrors) -> ForceErrors:
        """On the scale of another rival."""
        self._common, self._spread = other._own, other._spread
        return self

    def _by_record(self, theta: Array) -> list[Array]:
        return np.split(self._form.residual(theta, self._shift), self._form.starts[1:-1])

    def seen(self, theta: Array) -> Array:
        """Errors on the data so far, white and of unit variance by this rival's own noise."""
        return self._own.vector(self._by_record(theta))

    def errors(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Force left unexplained along the motion of an experiment, shape (n, bodies)."""
        if self._seen is None or self._seen[0] != id(record):
            data = Data(
                record.name, record.input_time, record.input, record.time, record.output, self._sample_time,
                np.zeros(0, dtype=int),
            )  # fmt: skip
            # The sensors, and so the speed that counts as rest, are those of the data so far.
            form = weak_form(self.engine, [data], self._form.width, self._form.rest_speed)
            if form is None:
                raise IdloopError("the experiment is too short for a force balance")
            self._seen = id(record), form
        # The experiment is simulated: its commands act at their stamps.
        return self._seen[1].residual(theta, 0.0)

    def scaled(self, raw: Array, decades: float = 0.0) -> Array:
        """Series of errors, white and of unit variance where the rival is right, shape (rows, k)."""
        return self._common.columns(raw)

    def transferred(self, raw: Array, decades: float) -> Array:
        """The same errors: no disturbance is assumed."""
        return raw

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance of the noise, in its own units."""
        return [np.eye(len(self._spread))]

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and bodies in what `scaled` returns."""
        return [(max(samples - self._common.whitener.order, 0), len(self._spread))]

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> dict[str, Any]:
        """Root mean square of the unexplained force by body."""
        left = np.sqrt(np.mean(self.errors(truth, start, theta) ** 2, axis=0))
        return {
            f"force[{body}]": {"value": float(value), "unit": self.model.units.force, "noise": float(noise)}
            for body, value, noise in zip(self.model.bodies, left, self._spread, strict=True)
        }


def force_decides(model: Model, data: Sequence[Data]) -> bool:
    """Whether model error and not sensor noise limits what can be decided, by a model fitted to the data."""
    form = weak_form(CachingEngine(model), data, NARROWEST)
    return form is not None and model_error_dominates(form, model.theta, _best_shift(form, model.theta))


def force_errors(models: Sequence[Model], data: Sequence[Data]) -> list[ForceErrors] | None:
    """Put rivals on one scale of forces; None when some motion is not measured."""
    engines = [CachingEngine(model) for model in models]
    if any(engine.layout(None).bodies != len(model.bodies) for engine, model in zip(engines, models, strict=True)):
        return None
    fitted = fit_by_force(engines[0], data, models[0].theta, accept_noise=True)
    if fitted is None:
        return None
    sample_time = float(np.median([d.sample_time for d in data]))
    errors = [ForceErrors(model, fitted.form, sample_time) for model in models]
    best = min((one for one in errors if np.isfinite(one.size)), key=lambda one: one.size, default=None)
    return None if best is None else [one.scaled_as(best) for one in errors]


def _best_shift(form: WeakForm, theta: Array) -> float:
    """Timing of the commands in the data so far [s]."""
    if not form.free_timing:
        return 0.0
    shifts = [float(share * form.sample_time) for share in _SHIFTS]
    power = [float(np.sum(form.residual(theta, shift) ** 2)) for shift in shifts]
    return shifts[int(np.argmin(power))]
