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

from idloop.diagnose.suggest_view import Difference
from idloop.errors import IdloopError
from idloop.estimate.choose import after_fit, before_fit
from idloop.estimate.dataset import Data
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.force import Balance, ForceCriterion, balance_of
from idloop.estimate.whitening import Whitener, choose_order, fit_whitener

if TYPE_CHECKING:
    from idloop.diagnose.experiment import Experiment
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
    cutoff : float
        Of the differentiating filter [Hz].
    sample_time : float
        Of the measurements [s].
    """

    whitener: Whitener
    weight: Array
    spread: Array
    cutoff: float
    sample_time: float

    def scaled(self, errors: Sequence[Array]) -> Array:
        """Errors by record as one vector, white and of unit variance."""
        return np.concatenate([(self.whitener.apply(e) @ self.weight.T).ravel() for e in errors])


class ForceView:
    """One rival seen through the force that it leaves unexplained.

    Parameters
    ----------
    model : Model
    balances : list of Balance
        Of the data so far.
    noise : ForceNoise
    """

    period = 1

    def __init__(self, model: Model, balances: Sequence[Balance], noise: ForceNoise) -> None:
        self.model, self.noise = model, noise
        self.engine = RememberingEngine(model)
        self._criterion = ForceCriterion(self.engine, balances)
        self._shift = _best_shift(self._criterion, model.theta)
        errors = self._criterion.errors(model.theta, self._shift)[0]
        self._own = force_noise(errors, noise.cutoff, noise.sample_time)
        self._seen: tuple[int, ForceCriterion] | None = None

    @property
    def stronger(self) -> list[float]:
        """No disturbance is assumed here that could be taken for stronger."""
        return []

    def seen(self, theta: Array) -> Array:
        """Errors on the data so far, white and of unit variance by this rival's own noise."""
        return self._own.scaled(self._criterion.errors(theta, self._shift)[0])

    def innovations(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Force that is left unexplained along the motion of an experiment, shape (n, bodies)."""
        if self._seen is None or self._seen[0] != id(record):
            step = self.noise.sample_time
            data = Data(
                record.name, record.input_time, record.input, record.time, record.output, step, np.zeros(0, dtype=int)
            )
            balance = balance_of(self.engine, data, None, self.noise.cutoff)
            if balance is None:
                raise IdloopError("the experiment is too short for a balance of forces")
            self._seen = id(record), ForceCriterion(self.engine, [balance])
        rule = self._seen[1]
        # The experiment is simulated: its commands act at their stamps.
        timing = np.zeros(1) if rule.free_timing else np.zeros(0)
        errors: list[Array] = rule.errors(theta, timing)[0]
        return errors[0]

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


def force_decides(model: Model, data: Sequence[Data], records: Sequence[Record]) -> bool:
    """Whether model error and not sensor noise limits what can be said, by the rule of `idloop.estimate.choose`.

    Parameters
    ----------
    model : Model
        Fitted to the records.
    data : sequence of Data
    records : sequence of Record
        The same experiments, with their references.
    """
    engine = RememberingEngine(model)
    if engine.layout(None).bodies != len(model.bodies):
        return False
    balances = [balance_of(engine, d, r) for d, r in zip(data, records, strict=True)]
    if before_fit(balances).criterion != "force":
        return False
    rule = ForceCriterion(engine, [b for b in balances if b is not None])
    return after_fit(engine, rule, model.theta, _best_shift(rule, model.theta)).criterion == "force"


def force_views(models: Sequence[Model], data: Sequence[Data]) -> list[ForceView] | None:
    """Put rivals on one scale of forces; None when some motion is not measured.

    Parameters
    ----------
    models : sequence of Model
    data : sequence of Data
        The data so far.

    Returns
    -------
    list of ForceView or None
    """
    engines = [RememberingEngine(model) for model in models]
    if any(engine.layout(None).bodies != len(model.bodies) for engine, model in zip(engines, models, strict=True)):
        return None
    first = [balance_of(engines[0], d, None) for d in data]
    known = [b for b in first if b is not None]
    if len(known) < len(first):
        return None
    cutoff = max(b.motion.cutoff for b in known)
    balances = [b for b in (balance_of(engines[0], d, None, cutoff) for d in data) if b is not None]
    step = float(np.median([d.sample_time for d in data]))
    best: tuple[float, ForceNoise] | None = None
    for engine, model in zip(engines, models, strict=True):
        rule = ForceCriterion(engine, balances)
        noise = force_noise(rule.errors(model.theta, _best_shift(rule, model.theta))[0], cutoff, step)
        size = -float(np.sum(np.log(np.diag(noise.weight))))
        if np.isfinite(size) and (best is None or size < best[0]):
            best = (size, noise)
    if best is None:
        return None
    return [ForceView(model, balances, best[1]) for model in models]


def force_noise(errors: Sequence[Array], cutoff: float, sample_time: float) -> ForceNoise:
    """Colour and size of what a balance of forces leaves over, by record.

    Parameters
    ----------
    errors : sequence of array, shape (n, bodies)
    cutoff : float
        [Hz]
    sample_time : float
        [s]

    Returns
    -------
    ForceNoise
    """
    series = [np.ascontiguousarray(e) for e in errors]
    whitener = fit_whitener(series, choose_order(series, _MOST_LAGS))
    white, stacked = np.concatenate([whitener.apply(e) for e in series]), np.concatenate(series)
    covariance = white.T @ white / max(len(white), 1)
    floor = max(1e-24 * float(np.max(np.diag(covariance))), 1e-60)
    weight = np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(len(covariance))))
    return ForceNoise(whitener, weight, np.sqrt(np.mean(stacked**2, axis=0)), cutoff, sample_time)


def _best_shift(rule: ForceCriterion, theta: Array) -> Array:
    """Timing of the commands in the data so far, as the criterion's nuisance parameter."""
    if not rule.free_timing:
        return np.zeros(0)
    shifts = [np.array([share * rule.sample_time]) for share in _SHIFTS]
    power = [sum(float(np.sum(e**2)) for e in rule.errors(theta, shift)[0]) for shift in shifts]
    return shifts[int(np.argmin(power))]
