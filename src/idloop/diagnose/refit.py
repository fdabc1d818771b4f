"""Maximum-likelihood refits of neighbouring models, all measured alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.setting import Setting
from idloop.errors import IdloopError
from idloop.estimate.criterion import Criterion
from idloop.estimate.innovations import LEAST_EXPONENT, MOST_EXPONENT, InnovationCriterion
from idloop.estimate.levenberg import minimise
from idloop.estimate.problem import Problem
from idloop.estimate.simulation import SimulationCriterion
from idloop.physics.model import Model

Array = NDArray[np.float64]

_MOST_ROUNDS = 10
_ITERATIONS_PER_ROUND = 3
# Gain in log-likelihood of one round below which the search ends, absolute and as part of what
# the model has gained on the one beside it: thousands need not be known to a hundredth.
_SETTLED, _SETTLED_PART = 0.05, 2e-4
# Where a cold start looks for the disturbance's intensity, in decades.
_COLD_EXPONENTS = (-8.0, -5.0, -2.0, 0.0, 2.0)


@dataclass(frozen=True)
class Refit:
    """A model at its maximum likelihood.

    Attributes
    ----------
    model : Model
        With the values found.
    criterion : Criterion
        The criterion, tuned for these values.
    problem : Problem
        Its noise model.
    point : array, shape (k + m,)
        Free parameters, then nuisance parameters.
    log_likelihood : float
        Concentrated over the noise model, less one for each of the noise model's parameters.
    step : array, shape (k + m,)
        Difference steps that suit.
    """

    model: Model
    criterion: Criterion
    problem: Problem
    point: Array
    log_likelihood: float
    step: Array

    @property
    def parameters(self) -> int:
        """Number of free model parameters."""
        return self.problem.parameters

    @property
    def nuisance(self) -> Array:
        """Nuisance parameters."""
        return self.point[self.parameters :]

    def residual(self) -> Array:
        """Whitened errors in units of their standard deviation, in one vector."""
        return self.problem.frozen_residual(self.point)

    def contributions(self) -> list[Array]:
        """Log-likelihood of every instant, by group of outputs and record.

        Instants that the whitening has no past for count as an average one.
        """
        found = []
        for raw, white, weight in zip(
            self.problem.errors(self.point), self.problem.whitened(self.point), self.problem.weights, strict=True
        ):
            constant = float(np.sum(np.log(np.diag(weight))))
            for before, after in zip(raw, white, strict=True):
                own = constant - 0.5 * np.sum((after @ weight.T) ** 2, axis=1)
                lead = len(before) - len(after)
                found.append(np.concatenate([np.full(lead, np.mean(own)), own]))
        return found


def log_likelihood(problem: Problem, point: Array) -> float:
    """Concentrated log-likelihood of a problem that has just been weighed at a point."""
    value = 0.0
    for raw, order, weight in zip(problem.errors(point), problem.orders, problem.weights, strict=True):
        samples, outputs = sum(len(e) for e in raw), raw[0].shape[1]
        value += samples * float(np.sum(np.log(np.diag(weight)))) - order * outputs**2
    return value if np.isfinite(value) else -np.inf


def residual_or_infinite(problem: Problem, point: Array) -> Array:
    """Residual, infinite where the model cannot be simulated."""
    try:
        return problem.frozen_residual(point)
    except (IdloopError, np.linalg.LinAlgError):
        return np.full(problem.length, np.inf)


def _weigh(problem: Problem, point: Array, orders: list[int] | None = None) -> float:
    with np.errstate(all="ignore"):
        try:
            problem.reweigh(point, True, orders)
            return log_likelihood(problem, point)
        except (np.linalg.LinAlgError, IdloopError):
            return -np.inf


def refit(
    setting: Setting,
    model: Model,
    starts: Sequence[Array] | None = None,
    beside: Refit | None = None,
    scale: Array | None = None,
    rounds: int = _MOST_ROUNDS,
) -> Refit:
    """Maximise the likelihood of a model's free parameters and its noise.

    Parameters
    ----------
    setting : Setting
    model : Model
    starts : sequence of array, shape (k,), optional
        Values to start from; the best one is taken. The model's own when left out.
    beside : Refit, optional
        A neighbouring model that is fitted already: its noise is where the search begins.
    scale : array, shape (k,), optional
        Typical sizes of the parameters.
    rounds : int
        Most rounds of the search; one tells promising models from others.

    Returns
    -------
    Refit

    Raises
    ------
    IdloopError
        The model gives no finite errors at any start.
    """
    criterion = setting.criterion(model)
    lower, upper = model.bounds
    choices = [np.clip(s, lower, upper) for s in (starts or [model.theta])]
    k = len(choices[0])
    size = np.abs(choices[0]) if scale is None else np.maximum(np.abs(scale), 1e-12)
    size = np.where(size > 0.0, size, 1.0)
    problem = Problem(criterion, k, None if setting.whiteners is None else list(setting.whiteners))
    if beside is not None and len(beside.nuisance) == len(criterion.nuisance()[0]):
        criterion.keep(beside.nuisance)
        if isinstance(criterion, SimulationCriterion):
            criterion.initial.scale = beside.criterion.initial.scale  # type: ignore[attr-defined]
    orders = beside.problem.orders if beside is not None else None
    best, theta = -np.inf, choices[0]
    for choice in choices:
        value, exponent = _start(criterion, problem, choice, orders, cold=beside is None)
        if value > best:
            best, theta, start_exponent = value, choice, exponent
    if not np.isfinite(best):
        raise IdloopError("the model gives no finite output at its starting values; check signs and magnitudes")
    if isinstance(criterion, InnovationCriterion):
        criterion.exponent = start_exponent
    step: Array | None = None
    best, kept = -np.inf, None
    for round_ in range(rounds):
        criterion.retune(theta)
        nuisance, low, high, nuisance_size = criterion.nuisance()
        point = np.concatenate([theta, nuisance])
        value = _weigh(problem, point, orders if round_ == 0 else None)
        if value == -np.inf:
            break
        found = minimise(
            lambda at: residual_or_infinite(problem, at),
            point,
            np.concatenate([lower, low]),
            np.concatenate([upper, high]),
            np.concatenate([np.maximum(np.abs(theta), 1e-3 * size), nuisance_size]),
            step if step is not None and len(step) == len(point) else None,
            max_iterations=_ITERATIONS_PER_ROUND,
            tolerance=1e-3,
            central=False,
        )
        theta, step = found.point[:k], found.step
        criterion.keep(found.point[k:])
        value = max(value, _weigh(problem, found.point))
        value = _leap(criterion, problem, theta, value)
        if value > best:
            kept = (theta, criterion.nuisance()[0], step)
        gained = value - beside.log_likelihood if beside is not None else 0.0
        if value < best + max(_SETTLED, _SETTLED_PART * gained) and round_ > 0:
            break
        best = max(best, value)
    if kept is None:
        raise IdloopError("the search left the region in which the model can be simulated")
    theta, nuisance, step = kept
    criterion.keep(nuisance)
    criterion.retune(theta)
    point = np.concatenate([theta, nuisance])
    value = _weigh(problem, point)
    fitted = model.with_values(dict(zip(model.free, (float(v) for v in theta), strict=True)))
    if isinstance(criterion, InnovationCriterion):
        fitted = replace(fitted, disturbance=float(np.sqrt(criterion.intensity)))
    return Refit(fitted, criterion, problem, point, value, step)


def transfer(setting: Setting, fit: Refit) -> Refit | None:
    """A fitted model on other records, its parameters and its noise as they are.

    Parameters
    ----------
    setting : Setting
        The other records.
    fit : Refit

    Returns
    -------
    Refit or None
        None where the model cannot be simulated on them.
    """
    try:
        criterion = setting.criterion(fit.model)
        theta = fit.model.theta
        if isinstance(criterion, InnovationCriterion):
            criterion.keep(fit.nuisance)
        criterion.retune(theta)
        start, low, high, size = criterion.nuisance()
        problem = Problem(criterion, len(theta), None if setting.whiteners is None else list(setting.whiteners))
        point = np.concatenate([theta, start])
        if _weigh(problem, point, fit.problem.orders) == -np.inf:
            return None
        if len(start) and not isinstance(criterion, InnovationCriterion):
            # Initial states and timing belong to the records, not to the model.
            found = minimise(
                lambda at: residual_or_infinite(problem, np.concatenate([theta, at])),
                start,
                low,
                high,
                size,
                max_iterations=5,
            )
            point = np.concatenate([theta, found.point])
        value = _weigh(problem, point, fit.problem.orders)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return Refit(fit.model, criterion, problem, point, value, fit.step)


def _start(
    criterion: Criterion, problem: Problem, theta: Array, orders: list[int] | None, cold: bool
) -> tuple[float, float]:
    """Log-likelihood at a start, with the disturbance's intensity at the best of a few."""
    try:
        criterion.retune(theta)
    except (np.linalg.LinAlgError, IdloopError, ValueError):
        return -np.inf, 0.0
    nuisance = criterion.nuisance()[0]
    if not isinstance(criterion, InnovationCriterion):
        return _weigh(problem, np.concatenate([theta, nuisance]), orders), 0.0
    here = float(nuisance[0])
    best = (-np.inf, here)
    for asked in _COLD_EXPONENTS if cold else (here, here - 2.0):
        exponent = float(np.clip(asked, LEAST_EXPONENT, MOST_EXPONENT))
        best = max(best, (_weigh(problem, np.append(theta, exponent), orders), exponent))
    return best


def _leap(criterion: Criterion, problem: Problem, theta: Array, value: float) -> float:
    """Go down with the disturbance's intensity by decades while the likelihood rises."""
    if not isinstance(criterion, InnovationCriterion):
        return value
    while criterion.exponent > LEAST_EXPONENT:
        lower = max(criterion.exponent - 2.0, LEAST_EXPONENT)
        trial = _weigh(problem, np.append(theta, lower))
        if trial <= value:
            break
        criterion.exponent, value = lower, trial
    return value
