"""Rivals held against an experiment by the balance of forces, where model error and not noise is what is left.

On a machine that is measured well enough for the force criterion an observer would explain whatever a rival
misses as disturbance; the force that it leaves unexplained along the motion does not let it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.rival_view import Difference
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_fit import fit_by_force, model_error_dominates
from idloop.estimation.force_balance.weak_form import NARROWEST, WeakForm, weak_form
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.whitening import Whitener, choose_order, fit_whitener

if TYPE_CHECKING:
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

_MOST_LAGS = 8
# Times from the stamp of a command to its action that are tried, in samples.
_SHIFTS = np.linspace(-1.0, 2.0, 13)


@dataclass(frozen=True)
class ForceNoise:
    """What the balance of forces leaves over when a model is right.

    Attributes
    ----------
    whitener : Whitener
    weight : array, shape (bodies, bodies)
        Inverse Cholesky factor of the whitened errors' covariance.
    spread : array, shape (bodies,)
        Standard deviation of the errors [force unit].
    width : int
        Of the windows [samples].
    sample_time : float
        Of the measurements [s].
    """

    whitener: Whitener
    weight: Array
    spread: Array
    width: int
    sample_time: float

    def scaled(self, errors: Sequence[Array]) -> Array:
        """Errors by record as one vector, white and of unit variance."""
        return np.concatenate([(self.whitener.apply(e) @ self.weight.T).ravel() for e in errors])


class ForceView:
    """One rival seen through the force that it leaves unexplained.

    Parameters
    ----------
    model : Model
    form : WeakForm
        Balance on the data so far.
    noise : ForceNoise
    """

    period = 1

    def __init__(self, model: Model, form: WeakForm, noise: ForceNoise) -> None:
        self.model, self.noise = model, noise
        self.engine = CachingEngine(model)
        self._form = form.with_engine(self.engine)
        self._shift = _best_shift(self._form, model.theta)
        self._own = force_noise(_by_record(self._form, model.theta, self._shift), noise.width, noise.sample_time)
        self._seen: tuple[int, WeakForm] | None = None

    @property
    def stronger(self) -> list[float]:
        """No disturbance is assumed here that could be taken for stronger."""
        return []

    def seen(self, theta: Array) -> Array:
        """Errors on the data so far, white and of unit variance by this rival's own noise."""
        return self._own.scaled(_by_record(self._form, theta, self._shift))

    def innovations(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Force that is left unexplained along the motion of an experiment, shape (n, bodies)."""
        if self._seen is None or self._seen[0] != id(record):
            step = self.noise.sample_time
            data = Data(
                record.name, record.input_time, record.input, record.time, record.output, step, np.zeros(0, dtype=int)
            )
            # The same sensors will tell standing from moving.
            form = weak_form(self.engine, [data], self.noise.width, self._form.rest_speed)
            if form is None:
                raise IdloopError("the experiment is too short for a balance of forces")
            self._seen = id(record), form
        # The experiment is simulated: its commands act at their stamps.
        return self._seen[1].residual(theta, 0.0)

    def scaled(self, raw: Array, decades: float = 0.0) -> Array:
        """Series of errors, white and of unit variance where the rival is right, shape (rows, k)."""
        noise = self.noise
        white = [noise.weight @ noise.whitener.apply(np.ascontiguousarray(raw[:, :, i])).T for i in range(raw.shape[2])]
        return np.asarray(np.stack(white, axis=2).transpose(1, 0, 2).reshape(-1, raw.shape[2]))

    def transferred(self, raw: Array, decades: float) -> Array:
        """The same: no disturbance is assumed here."""
        return raw

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance of the noise, in its own units."""
        return [np.eye(len(self.noise.spread))]

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and bodies in what `scaled` returns."""
        return [(max(samples - self.noise.whitener.order, 0), len(self.noise.spread))]

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> list[Difference]:
        """Force that this rival leaves unexplained."""
        left = np.sqrt(np.mean(self.innovations(truth, start, theta) ** 2, axis=0))
        return [
            Difference(f"force[{body}]", float(value), self.model.units.force, float(noise))
            for body, value, noise in zip(self.model.bodies, left, self.noise.spread, strict=True)
        ]


def force_decides(model: Model, data: Sequence[Data]) -> bool:
    """Whether model error and not sensor noise limits what can be said.

    Parameters
    ----------
    model : Model
        Fitted to the records.
    data : sequence of Data
    """
    form = weak_form(CachingEngine(model), data, NARROWEST)
    if form is None:
        return False
    shift = _best_shift(form, model.theta)
    return model_error_dominates(form, model.theta, shift)


def force_views(models: Sequence[Model], data: Sequence[Data]) -> list[ForceView] | None:
    """Put rivals on one scale of forces; None when some motion is not measured.

    Parameters
    ----------
    models : sequence of Model
    data : sequence of Data
        The data so far.
    """
    engines = [CachingEngine(model) for model in models]
    if any(engine.layout(None).bodies != len(model.bodies) for engine, model in zip(engines, models, strict=True)):
        return None
    fitted = fit_by_force(engines[0], data, models[0].theta, accept_noise=True)
    if fitted is None:
        return None
    form, step = fitted.form, float(np.median([d.sample_time for d in data]))
    best: tuple[float, ForceNoise] | None = None
    for engine, model in zip(engines, models, strict=True):
        own = form.with_engine(engine)
        noise = force_noise(_by_record(own, model.theta, _best_shift(own, model.theta)), form.width, step)
        size = -float(np.sum(np.log(np.diag(noise.weight))))
        if np.isfinite(size) and (best is None or size < best[0]):
            best = (size, noise)
    if best is None:
        return None
    return [ForceView(model, form, best[1]) for model in models]


def force_noise(errors: Sequence[Array], width: int, sample_time: float) -> ForceNoise:
    """Colour and size of what a balance of forces leaves over, by record.

    Parameters
    ----------
    errors : sequence of array, shape (n, bodies)
    width : int
        [samples]
    sample_time : float
        [s]
    """
    series = [np.ascontiguousarray(e) for e in errors]
    whitener = fit_whitener(series, choose_order(series, _MOST_LAGS))
    white, stacked = np.concatenate([whitener.apply(e) for e in series]), np.concatenate(series)
    covariance = white.T @ white / max(len(white), 1)
    floor = max(1e-24 * float(np.max(np.diag(covariance))), 1e-60)
    weight = np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(len(covariance))))
    return ForceNoise(whitener, weight, np.sqrt(np.mean(stacked**2, axis=0)), width, sample_time)


def _by_record(form: WeakForm, theta: Array, shift: float) -> list[Array]:
    """Unexplained force of every record."""
    return np.split(form.residual(theta, shift), form.starts[1:-1])


def _best_shift(form: WeakForm, theta: Array) -> float:
    """Timing of the commands in the data so far [s]."""
    if not form.free_timing:
        return 0.0
    shifts = [float(share * form.sample_time) for share in _SHIFTS]
    power = [float(np.sum(form.residual(theta, shift) ** 2)) for shift in shifts]
    return shifts[int(np.argmin(power))]
