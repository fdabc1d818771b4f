"""One noise model for all rivals, read off the data so far."""

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

# Lags of the common noise model at most; more only cost time.
_MOST_LAGS = 8
# Decades of the disturbance's intensity that are tried where no model states it.
_EXPONENTS = (-12.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0, 2.0)


@dataclass(frozen=True)
class Noise:
    """What is left of the data so far when a model is right; the same for all rivals.

    Attributes
    ----------
    groups : list of list of int
        Outputs that are measured together.
    every : list of int
        Each group is measured at every so many-th instant.
    whiteners : list of Whitener
        Colour of the innovations, by group.
    weights : list of array
        Inverse Cholesky factor of the whitened innovations' covariance, by group.
    sensors : array, shape (p,)
        Measurement noise [output unit].
    intensity : float
        Of the disturbance force [force²/s].
    exponent : float
        The same in the decades of the innovation criterion.
    force : float
        Typical drive force.
    sample_time : float
        Of the measurements [s].
    """

    groups: list[list[int]]
    every: list[int]
    whiteners: list[Whitener]
    weights: list[Array]
    sensors: Array
    intensity: float
    exponent: float
    force: float
    sample_time: float

    def scaled(self, errors: Sequence[Sequence[Array]]) -> Array:
        """Errors by group and record as one vector, white and of unit variance."""
        rows = zip(errors, self.whiteners, self.weights, strict=True)
        return np.concatenate([(white.apply(e) @ weight.T).ravel() for group, white, weight in rows for e in group])

    def lengths(self, samples: int) -> list[tuple[int, int]]:
        """Samples and outputs of each group in the vector of an experiment."""
        counts = [-(-samples // step) - white.order for step, white in zip(self.every, self.whiteners, strict=True)]
        return [(max(count, 0), len(group)) for count, group in zip(counts, self.groups, strict=True)]


def common_noise(models: Sequence[Model], data: list[Data]) -> Noise:
    """Noise of the rival that explains the data so far best, its disturbance included."""
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
    whiteners = [fit_whitener(group, choose_order(group, _MOST_LAGS)) for group in errors]
    weights = []
    for group, whitener in zip(errors, whiteners, strict=True):
        white = np.concatenate([whitener.apply(e) for e in group])
        covariance = white.T @ white / max(len(white), 1)
        floor = max(1e-24 * float(np.max(np.diag(covariance))), 1e-60)
        weights.append(np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(len(covariance)))))
    groups = output_groups(data)
    instants = sum(len(d.time) for d in data)
    known = [sum(int(np.sum(np.isfinite(d.output[:, group[0]]))) for d in data) for group in groups]
    return Noise(
        groups,
        [max(round(instants / max(count, 1)), 1) for count in known],
        whiteners,
        weights,
        sensors,
        unit * 10.0**exponent,
        exponent,
        force,
        float(np.median([d.sample_time for d in data])),
    )
