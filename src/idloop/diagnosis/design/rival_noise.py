"""The common noise model of rivals, read off the data so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, force_scale, output_groups, output_noise
from idloop.estimation.observer.innovations import LEAST_EXPONENT, MOST_EXPONENT, InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.statistics.whitening import Whitener, choose_order, fit_whitener

if TYPE_CHECKING:
    from idloop.physics import Model

Array = NDArray[np.float64]

# Lags of a noise model; more only cost time.
MOST_LAGS = 8
# Decades of the disturbance's intensity that are tried where no model states it.
_EXPONENTS = (-12.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0, 2.0)


@dataclass(frozen=True)
class Whitening:
    """Brings errors to white noise of unit variance."""

    whitener: Whitener
    weight: Array  # inverse Cholesky factor of the whitened errors' covariance, shape (p, p)

    @classmethod
    def of(cls, series: Sequence[Array]) -> Whitening:
        """Fitted to errors by record, each of shape (n, p)."""
        series = [np.ascontiguousarray(errors) for errors in series]
        whitener = fit_whitener(series, choose_order(series, MOST_LAGS))
        white = np.concatenate([whitener.apply(errors) for errors in series])
        covariance = white.T @ white / max(len(white), 1)
        floor = max(1e-24 * float(np.max(np.diag(covariance))), 1e-60)
        weight = np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(len(covariance))))
        return cls(whitener, weight)

    def vector(self, errors: Sequence[Array]) -> Array:
        """Errors by record as one white vector."""
        return np.concatenate([(self.whitener.apply(one) @ self.weight.T).ravel() for one in errors])

    def columns(self, raw: Array) -> Array:
        """Series of errors (n, p, k) as white columns (rows, k)."""
        white = [self.weight @ self.whitener.apply(np.ascontiguousarray(raw[:, :, i])).T for i in range(raw.shape[2])]
        return np.asarray(np.stack(white, axis=2).transpose(1, 0, 2).reshape(-1, raw.shape[2]))


@dataclass(frozen=True)
class Noise:
    """Noise of the measurements and of the disturbance, the same for all rivals."""

    groups: list[list[int]]  # outputs that are measured together
    every: list[int]  # each group is measured at every n-th instant
    whitenings: list[Whitening]  # of the innovations, by group
    sensors: Array  # measurement noise, shape (p,) [output unit]
    intensity: float  # of the disturbance force [force²/s]
    exponent: float  # the same in decades of the innovation criterion
    force: float  # typical drive force
    sample_time: float  # of the measurements [s]

    def scaled(self, errors: Sequence[Sequence[Array]]) -> Array:
        """Errors by group and record as one vector, white and of unit variance."""
        return np.concatenate([own.vector(group) for own, group in zip(self.whitenings, errors, strict=True)])


def common_noise(models: Sequence[Model], data: list[Data]) -> Noise:
    """Noise and disturbance of the rival that explains the data so far best."""
    engines = [CachingEngine(model) for model in models]
    sensors = output_noise(models[0], data)
    force = force_scale(engines[0], data)
    unit = force**2 / max(float(d.time[-1] - d.time[0]) for d in data)
    best: tuple[float, float, list[list[Array]]] | None = None
    for engine, model in zip(engines, models, strict=True):
        stated = model.disturbance
        exponents = _EXPONENTS if stated is None else (float(np.log10(max(stated**2, 1e-300) / unit)),)
        for tried in exponents:
            exponent = float(np.clip(tried, LEAST_EXPONENT, MOST_EXPONENT))
            criterion = InnovationCriterion(engine, data, sensors, force, exponent)
            point = np.concatenate([model.theta, [exponent, criterion.memory]])
            problem = LeastSquaresProblem(criterion, len(model.theta))
            try:
                problem.reweigh(point, whiten=False)
            except (IdloopError, np.linalg.LinAlgError):
                continue
            if np.isfinite(problem.objective) and (best is None or problem.objective < best[0]):
                best = (problem.objective, exponent, problem.errors(point))
    if best is None:
        raise IdloopError("none of the models can be simulated along these records; fit them first")
    _, exponent, errors = best
    groups = output_groups(data)
    instants = sum(len(d.time) for d in data)
    known = [sum(int(np.sum(np.isfinite(d.output[:, group[0]]))) for d in data) for group in groups]
    return Noise(
        groups,
        [max(round(instants / max(count, 1)), 1) for count in known],
        [Whitening.of(group) for group in errors],
        sensors,
        unit * 10.0**exponent,
        exponent,
        force,
        float(np.median([d.sample_time for d in data])),
    )
