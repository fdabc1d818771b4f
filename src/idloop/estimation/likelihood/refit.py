"""Maximum-likelihood refits of neighbouring models, all measured alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.likelihood.disturbance import (
    COLD,
    FAR,
    GLIMPSE,
    LONG_MEMORY,
    NEAR,
    NONE,
    SETTLED,
    Disturbance,
    aside,
    elsewhere,
    glimpsed,
    tune,
)
from idloop.estimation.likelihood.estimation_problem import Setting
from idloop.estimation.likelihood.start_evidence import start_log_likelihood
from idloop.estimation.likelihood.weighing import projected, residual_or_infinite, weigh
from idloop.estimation.observer.innovations import MOST_EXPONENT, WALK, InnovationCriterion
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise
from idloop.estimation.optimisation.problem import Problem
from idloop.estimation.simulation import SimulationCriterion
from idloop.physics.model import Model

Array = NDArray[np.float64]

# Noise asks for fewer lags of whitening than this.
MANY_LAGS = 6
_MOST_ROUNDS = 10
_ITERATIONS_PER_ROUND = 6
# Gain of one round below which the search ends, as part of what the model has gained on the one beside it:
# thousands need not be known to a hundredth.
_SETTLED_PART = 2e-4
# Change of the whitened errors, in all, below which a unit of a parameter, a typical change of a nuisance, is not felt.
_LEAST_SLOPE, _FELT = 1e-6, 0.1
# Parts of an effect's strength at which a search may start as well.
FAN = (0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.2, 1.4, 2.0, 2.8)
# Promised rise of the log-likelihood at which a round ends.
_PROMISE = 0.02


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
    slopes : array, shape (n, k), or None
        Jacobian of the whitened errors, roughly: where searches of neighbouring models begin.
    rounds : int
        Of the search.
    settled : bool
        Whether it ended by itself.
    """

    model: Model
    criterion: Criterion
    problem: Problem
    point: Array
    log_likelihood: float
    step: Array
    slopes: NDArray[np.float32] | None = None
    rounds: int = 0
    settled: bool = True

    @property
    def parameters(self) -> int:
        """Number of free model parameters."""
        return self.problem.parameters

    @property
    def choices(self) -> int:
        """Number of free model parameters and of whole numbers, such as harmonics, that a search chose."""
        return self.parameters + sum(spec.integer for active in self.model.effects for spec in active.effect.parameters)

    @property
    def nuisance(self) -> Array:
        """Nuisance parameters."""
        return self.point[self.parameters :]

    def residual(self) -> Array:
        """Whitened errors in units of their standard deviation, in one vector."""
        return self.problem.frozen_residual(self.point)

    @cached_property
    def jacobian(self) -> Array:
        """Slopes of the residual by the parameters and the nuisance parameters, shape (n, k + m); 0 where unknown."""
        lower, upper = self.model.bounds
        _, low, high, size = self.criterion.nuisance()
        found, _ = difference_jacobian(
            lambda at: residual_or_infinite(self.problem, at),
            self.point,
            self.residual(),
            np.concatenate([lower, low]),
            np.concatenate([upper, high]),
            self.step,
            np.concatenate([np.maximum(np.abs(self.point[: self.parameters]), 1e-12), size]),
        )
        found[:, ~np.all(np.isfinite(found), axis=0)] = 0.0
        return np.asarray(found)

    @property
    def felt(self) -> NDArray[np.bool_]:
        """Which of its columns the errors feel, shape (k + m,)."""
        return felt(self.jacobian, self.parameters, self.criterion.nuisance()[3])

    @property
    def coloured(self) -> float:
        """What the whitening explains of the errors: log of the ratio of deviations, the most of all groups."""
        found = 0.0
        for group, weight in zip(self.problem.errors(self.point), self.problem.weights, strict=True):
            raw = np.concatenate(group) @ weight.T
            sign, log_determinant = np.linalg.slogdet(raw.T @ raw / len(raw))
            found = max(found, float(0.5 * log_determinant / len(weight)) if sign > 0 else 0.0)
        return found

    @property
    def whitens_much(self) -> bool:
        """Whether the whitening has more lags than noise asks for."""
        return max(self.problem.orders, default=0) >= MANY_LAGS

    @cached_property
    def at_start(self) -> float:
        """Log-likelihood of the first instants, beyond what `log_likelihood` counts for them."""
        return start_log_likelihood(self.problem, self.point)

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


def felt(slopes: Array, parameters: int, size: Array) -> NDArray[np.bool_]:
    """Which columns of a Jacobian the errors feel.

    A disturbance that is not there has no strength to be uncertain of: its slope is rounding, or that of a bound,
    along which the errors may lie.

    Parameters
    ----------
    slopes : array, shape (n, k + m)
        Of the whitened errors, by the model's parameters and the nuisance parameters.
    parameters : int
        k.
    size : array, shape (m,)
        Typical change of each nuisance parameter.
    """
    norms = np.linalg.norm(slopes, axis=0)
    least = np.concatenate([np.full(parameters, _LEAST_SLOPE), _FELT / np.maximum(np.abs(size), 1e-300)])
    return np.asarray(np.isfinite(norms) & (norms > least))


def refit(
    setting: Setting,
    model: Model,
    starts: Sequence[Array] | None = None,
    beside: Refit | None = None,
    scale: Array | None = None,
    rounds: int = _MOST_ROUNDS,
    reconsider: bool = False,
    orders: list[int] | None = None,
    limits: Disturbance = (MOST_EXPONENT, WALK),
    calm: bool = False,
    near: bool = False,
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
    reconsider : bool
        Choose the order of the whitening anew instead of the neighbour's.
    orders : list of int, optional
        Orders of the whitening instead of the neighbour's, one for each group of outputs.
    limits : tuple of float
        Largest intensity and longest memory that the disturbance may have [decades; of a sample].
    calm : bool
        Start as well from where the model is best without any disturbance, should that be better: a missing
        effect makes its neighbour's disturbance strong, and from there parameters and disturbance creep.
    near : bool
        The model's values are those of another view: one search from there, with the noise that it finds.

    Raises
    ------
    IdloopError
        The model gives no finite errors at any start.
    """
    fit = _search(setting, model, starts, beside, scale, rounds, reconsider, orders, limits, calm)
    if near:
        return fit
    if beside is None:
        fit = _by_way_of_the_plain_machine(setting, model, fit, rounds, orders, limits)
    if orders is not None or not (beside is None or reconsider):
        return fit
    found = [fit]
    elsewhere = _disturbance_elsewhere(setting, fit)
    if elsewhere is not None:
        found.append(_search(setting, fit.model, None, elsewhere, scale, rounds, True, None))
    if any(fit.problem.orders):
        # A whitening of few lags and a disturbance that remembers explain much the same: which is the plainer way?
        found.append(_search(setting, fit.model, None, found[-1], scale, rounds, False, [0] * len(fit.problem.orders)))
    return max(found, key=lambda one: one.log_likelihood)


def _search(
    setting: Setting,
    model: Model,
    starts: Sequence[Array] | None,
    beside: Refit | None,
    scale: Array | None,
    rounds: int,
    reconsider: bool,
    orders: list[int] | None,
    limits: Disturbance = (MOST_EXPONENT, WALK),
    calm: bool = False,
) -> Refit:
    """The search of `refit`, which may end at the next best disturbance."""
    criterion = setting.criterion(model)
    if isinstance(criterion, InnovationCriterion):
        criterion.strongest, criterion.longest = limits
    lower, upper = model.bounds
    choices = [np.clip(s, lower, upper) for s in (starts or [model.theta])]
    k = len(choices[0])
    size = np.abs(choices[0]) if scale is None else np.maximum(np.abs(scale), 1e-12)
    size = np.where(size > 0.0, size, 1.0)
    problem = setting.problem(criterion, k)
    if beside is not None and len(beside.nuisance) == len(criterion.nuisance()[0]):
        criterion.keep(beside.nuisance)
        if isinstance(criterion, SimulationCriterion):
            criterion.initial.scale = beside.criterion.initial.scale  # type: ignore[attr-defined]
    # Neighbours are compared with one order of whitening, so that each contains the other's noise.
    if orders is None and beside is not None and not reconsider:
        orders = beside.problem.orders
    best, theta = -np.inf, choices[0]
    failure: Exception | None = None
    for choice in choices:
        try:
            value, disturbance = _start(criterion, problem, choice, orders, beside is None and len(choices) > 1)
        except (np.linalg.LinAlgError, IdloopError, ValueError) as error:
            failure = error
            continue
        if value > best:
            best, theta, start = value, choice, disturbance
    if not np.isfinite(best):
        if isinstance(failure, IdloopError):
            raise failure
        raise IdloopError("the model gives no finite output at its starting values; check signs and magnitudes")
    if calm and isinstance(criterion, InnovationCriterion):
        value, elsewhere = _under_disturbance(criterion, problem, theta, (lower, upper), size, NONE, orders)
        if value > best:
            theta, start = elsewhere, np.array(NONE)
    criterion.keep(start)
    glimpse = criterion.glimpse(GLIMPSE) if isinstance(criterion, InnovationCriterion) else None
    step: Array | None = None
    slopes = _slopes_of(beside, model) if beside is not None else None
    best, kept, settled = -np.inf, None, False
    for round_ in range(rounds):
        criterion.retune(theta)
        # The first round moves the parameters so far that its best disturbance need not be near the next.
        early = round_ < 2
        probes: Sequence[Disturbance] = (COLD if beside is None else aside(criterion)) if early else ()
        reach = FAR if round_ == 0 else NEAR
        if early and glimpse is not None:
            probes, reach = [glimpsed(glimpse, setting, criterion, theta, orders, probes, reach)], NEAR * round_
        value = tune(criterion, problem, theta, orders, probes, reach)
        if value == -np.inf:
            break
        nuisance, low, high, nuisance_size = criterion.nuisance()
        held = nuisance if isinstance(criterion, InnovationCriterion) else nuisance[:0]
        moving = len(nuisance) - len(held)
        found = minimise(
            lambda at, held=held: projected(problem, np.concatenate([at, held])),  # type: ignore[misc]
            np.concatenate([theta, nuisance[:moving]]),
            np.concatenate([lower, low[:moving]]),
            np.concatenate([upper, high[:moving]]),
            np.concatenate([np.maximum(np.abs(theta), 1e-3 * size), nuisance_size[:moving]]),
            step if step is not None and len(step) == k + moving else None,
            max_iterations=_ITERATIONS_PER_ROUND,
            tolerance=_PROMISE,
            quick=True,
            jacobian=slopes if slopes is not None and slopes.shape == (problem.length, k + moving) else None,
            draft=rounds == 1,
        )
        theta, step, slopes = found.point[:k], found.step, found.jacobian
        nuisance = np.concatenate([found.point[k:], held])
        criterion.keep(nuisance)
        value = max(value, weigh(problem, np.concatenate([theta, nuisance]), orders))
        if value > best:
            steps = np.concatenate([step, nuisance_size[moving:] * 1e-4])
            kept = (theta, nuisance, steps, slopes[:, :k].astype(np.float32))
        gained = value - beside.log_likelihood if beside is not None else 0.0
        if value < best + max(SETTLED, _SETTLED_PART * gained) and round_ > 0:
            settled = True
            break
        best = max(best, value)
    if kept is None:
        raise IdloopError("the search left the region in which the model can be simulated")
    theta, nuisance, step, rough = kept
    criterion.keep(nuisance)
    criterion.retune(theta)
    point = np.concatenate([theta, nuisance])
    value = weigh(problem, point, orders)
    fitted = model.with_values(dict(zip(model.free, (float(v) for v in theta), strict=True)))
    if isinstance(criterion, InnovationCriterion):
        # What forgets quickly is no walk, which is what an observer elsewhere takes a disturbance for.
        walks = criterion.memory >= LONG_MEMORY
        fitted = replace(fitted, disturbance=float(np.sqrt(criterion.intensity)) if walks else None)
    return Refit(fitted, criterion, problem, point, value, step, rough, round_ + 1, settled)


def _by_way_of_the_plain_machine(
    setting: Setting, model: Model, fit: Refit, rounds: int, orders: list[int] | None, limits: Disturbance
) -> Refit:
    """The fit, or a better one that begins where the machine without its effects is best.

    While the machine itself is far off, a search may drive an effect to where it does nothing any more.
    """
    levels = {active.name: active.effect.strength or active.effect.from_a_level for active in model.effects}
    names = [f"{name}.{level}" for name, level in levels.items() if f"{name}.{level}" in model.free]
    if not names:
        return fit
    plain_model = model.without_effects(name.rpartition(".")[0] for name in names)
    try:
        plain = _search(setting, plain_model, None, None, None, rounds, False, orders, limits)
        start = model.with_values(plain.model.values).theta
        choices = [start]
        for name in names:
            for share in FAN:
                choices.append(start.copy())
                choices[-1][model.free.index(name)] *= share
        other = _search(setting, model, choices, plain, None, rounds, True, orders, limits)
    except (IdloopError, np.linalg.LinAlgError):
        return fit
    return max(fit, other, key=lambda one: one.log_likelihood)


def _slopes_of(beside: Refit, model: Model) -> Array | None:
    """Jacobian of a neighbouring model, in the order of this one's parameters; NaN for those that are new."""
    if beside.slopes is None:
        return None
    places = {name: place for place, name in enumerate(beside.model.free)}
    slopes = np.full((len(beside.slopes), len(model.free)), np.nan)
    for column, name in enumerate(model.free):
        if name in places:
            slopes[:, column] = beside.slopes[:, places[name]]
    return slopes


def _disturbance_elsewhere(setting: Setting, fit: Refit) -> Refit | None:
    """The same model with another disturbance altogether, where that explains its errors better."""
    if not isinstance(fit.criterion, InnovationCriterion):
        return None
    theta = fit.point[: fit.parameters]
    found = elsewhere(setting, fit.model, theta, (float(fit.nuisance[0]), float(fit.nuisance[1])), fit.problem.orders)
    return None if found is None else replace(fit, point=np.append(theta, found))


def refit_or_none(
    setting: Setting,
    model: Model,
    starts: Sequence[Array] | None = None,
    beside: Refit | None = None,
    scale: Array | None = None,
    rounds: int = _MOST_ROUNDS,
    calm: bool = False,
    near: bool = False,
) -> Refit | None:
    """As `refit`; None where the model cannot be simulated."""
    try:
        return refit(setting, model, starts, beside, scale, rounds, calm=calm, near=near)
    except (IdloopError, np.linalg.LinAlgError):
        return None


def transfer(setting: Setting, fit: Refit, *, own_disturbance: bool = False) -> Refit | None:
    """A fitted model on other records, its parameters and its noise as they are.

    Parameters
    ----------
    setting : Setting
        The other records.
    fit : Refit
    own_disturbance : bool
        Find the disturbance of the other records: what pushed the machine there need not be what pushed it here.

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
        problem = setting.problem(criterion, len(theta))
        point = np.concatenate([theta, start])
        if weigh(problem, point, fit.problem.orders) == -np.inf:
            return None
        if isinstance(criterion, InnovationCriterion):
            if own_disturbance:
                tune(criterion, problem, theta, fit.problem.orders, (), FAR)
                point = np.concatenate([theta, criterion.nuisance()[0]])
        elif len(start):
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
        value = weigh(problem, point, fit.problem.orders)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return Refit(fit.model, criterion, problem, point, value, fit.step)


def _start(
    criterion: Criterion, problem: Problem, theta: Array, orders: list[int] | None, cold: bool
) -> tuple[float, Array]:
    """Log-likelihood at a start, and the nuisance there: the best of a few disturbances."""
    criterion.retune(theta)
    nuisance = criterion.nuisance()[0]
    tries = [nuisance]
    if isinstance(criterion, InnovationCriterion) and cold:
        tries = [np.array(at) for at in COLD]
    values = [weigh(problem, np.concatenate([theta, at]), orders) for at in tries]
    best = int(np.argmax(values))
    return values[best], tries[best]


def _under_disturbance(
    criterion: Criterion,
    problem: Problem,
    theta: Array,
    bounds: tuple[Array, Array],
    size: Array,
    disturbance: Disturbance,
    orders: list[int] | None,
) -> tuple[float, Array]:
    """Log-likelihood and parameters at which the model is best under one disturbance."""
    try:
        criterion.retune(theta)
        if weigh(problem, np.append(theta, disturbance), orders) == -np.inf:
            return -np.inf, theta
        found = minimise(
            lambda at: projected(problem, np.append(at, disturbance)),
            theta,
            *bounds,
            np.maximum(np.abs(theta), 1e-3 * size),
            max_iterations=2 * _ITERATIONS_PER_ROUND,
            tolerance=_PROMISE,
            quick=True,
        ).point
        criterion.retune(found)
        return weigh(problem, np.append(found, disturbance), orders), found
    except (IdloopError, np.linalg.LinAlgError):
        return -np.inf, theta
