"""Maximum-likelihood fits of neighbouring models to the same data, with comparable log-likelihoods."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.likelihood.disturbance import (
    COLD_START_GRID,
    FIRST_REACH,
    LONG_MEMORY,
    NEGLIGIBLE_GAIN,
    NEXT_REACH,
    NO_DISTURBANCE,
    SUBSET_SAMPLES,
    Disturbance,
    fit_disturbance,
    neighbouring_disturbances,
    other_disturbance,
    tuned_on_subset,
)
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.log_likelihood import start_log_likelihood, weigh
from idloop.estimation.observer.innovations import MOST_EXPONENT, WALK, InnovationCriterion
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.covariance import estimate_covariance
from idloop.estimation.statistics.undetermined import standard_errors
from idloop.physics.model import Model

_Arguments = ParamSpec("_Arguments")

# Measurement noise needs fewer lags of whitening than this.
MANY_LAGS = 6
_MOST_ROUNDS = 10
_ITERATIONS_PER_ROUND = 6
# The search ends when a round gains less than this part of the gain on the neighbouring model.
_SETTLED_PART = 2e-4
# Norm of the change of the whitened errors below which they do not depend on a parameter (change by one unit) or on a
# nuisance parameter (typical change).
_LEAST_SLOPE, _LEAST_CHANGE = 1e-6, 0.1
# Factors on an effect's strength for further starting values.
STRENGTH_FACTORS = (0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.2, 1.4, 2.0, 2.8)
# Predicted rise of the log-likelihood at which a round ends.
_PROMISE = 0.02


@dataclass(frozen=True)
class Refit:
    """A model at the maximum of its likelihood."""

    model: Model  # with the estimates
    criterion: Criterion  # tuned for the estimates
    problem: LeastSquaresProblem  # with the noise model of the estimates
    point: Array  # shape (k + m,): free parameters, then nuisance parameters
    log_likelihood: float  # as of `weigh`
    step: Array  # shape (k + m,): difference steps
    # shape (n, k): approximate Jacobian of the whitened errors, with which searches of neighbouring models begin
    slopes: NDArray[np.float32] | None = None
    rounds: int = 0  # rounds of the search
    settled: bool = True  # whether the search converged

    @property
    def parameters(self) -> int:
        """Number of free model parameters."""
        return self.problem.parameters

    @property
    def choices(self) -> int:
        """Number of free parameters and of integers, such as harmonics, that a search chose."""
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
            lambda at: self.problem.residual_or_infinite(at, frozen=True),
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
    def sensitive(self) -> Mask:
        """Columns of the Jacobian on which the errors depend, shape (k + m,).

        A disturbance of no intensity has no uncertain intensity: its column is rounding, or the slope of a bound.
        """
        size = np.maximum(np.abs(self.criterion.nuisance()[3]), 1e-300)
        norms = np.linalg.norm(self.jacobian, axis=0)
        least = np.concatenate([np.full(self.parameters, _LEAST_SLOPE), _LEAST_CHANGE / size])
        return np.asarray(np.isfinite(norms) & (norms > least))

    @property
    def covariance(self) -> Array:
        """Covariance of the free parameters under coloured errors, shape (k, k); not finite where not determined."""
        k, jacobian = self.parameters, self.jacobian
        jacobian = jacobian[:, (np.arange(jacobian.shape[1]) < k) | self.sensitive]
        return np.asarray(estimate_covariance(self.problem, self.point, self.residual(), jacobian)[:k, :k])

    def with_stderr(self) -> Model:
        """The fitted model with the standard errors of its free parameters."""
        values = {name: float(v) for name, v in zip(self.model.free, self.point, strict=False)}
        model = self.model.with_values(values)
        return model.with_values({}, standard_errors(model, self.covariance))

    @property
    def whitening_gain(self) -> float:
        """Part of the errors that the whitening explains: log of the ratio of deviations, the largest of all groups."""
        found = 0.0
        for group, weight in zip(self.problem.errors(self.point), self.problem.weights, strict=True):
            raw = np.concatenate(group) @ weight.T
            sign, log_determinant = np.linalg.slogdet(raw.T @ raw / len(raw))
            found = max(found, float(0.5 * log_determinant / len(weight)) if sign > 0 else 0.0)
        return found

    @property
    def many_lags(self) -> bool:
        """Whether the whitening has more lags than measurement noise needs."""
        return max(self.problem.orders, default=0) >= MANY_LAGS

    @cached_property
    def initial_log_likelihood(self) -> float:
        """As of `start_log_likelihood`."""
        return start_log_likelihood(self.problem, self.point)

    def contributions(self) -> list[Array]:
        """Log-likelihood of every instant, by group of outputs and record.

        Instants without a complete past for the whitening count as the average one.
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


def refit(
    estimation: EstimationProblem,
    model: Model,
    starts: Sequence[Array] | None = None,
    neighbour: Refit | None = None,
    scale: Array | None = None,
    rounds: int = _MOST_ROUNDS,
    choose_orders: bool = False,
    orders: list[int] | None = None,
    limits: Disturbance = (MOST_EXPONENT, WALK),
    try_undisturbed: bool = False,
    near: bool = False,
) -> Refit:
    """Maximise the likelihood of a model's free parameters and its noise.

    Parameters
    ----------
    estimation : EstimationProblem
    model : Model
    starts : sequence of array, shape (k,), optional
        Starting values, of which the best are taken; the model's own when left out.
    neighbour : Refit, optional
        Fit of a neighbouring model, whose noise model the search begins with.
    scale : array, shape (k,), optional
        Typical sizes of the parameters.
    rounds : int
        Most rounds of the search; one is enough to rank models.
    choose_orders : bool
        Choose the whitening orders from the errors, not from the neighbour.
    orders : list of int, optional
        Whitening orders, one for each group of outputs.
    limits : tuple of float
        Largest intensity and longest memory of the disturbance [decades; of a sample].
    try_undisturbed : bool
        Start from the optimum without any disturbance as well: a missing effect makes the neighbour's disturbance
        strong, from where parameters and disturbance converge slowly.
    near : bool
        The starting values are those of another criterion: search once from there.

    Raises
    ------
    IdloopError
        The model gives no finite errors at any starting values.
    """
    model = estimation.resolvable(model)
    fit = _search(estimation, model, starts, neighbour, scale, rounds, choose_orders, orders, limits, try_undisturbed)
    if neighbour is None and not fit.settled:
        # It began with the noise of errors that were far from their optimum, and may have stayed near that noise.
        again = _search(estimation, fit.model, None, None, scale, rounds, choose_orders, orders, limits)
        fit = max(fit, again, key=lambda one: one.log_likelihood)
    if near:
        return fit
    if neighbour is None:
        fit = _from_model_without_effects(estimation, model, fit, rounds, orders, limits)
    if orders is not None or not (neighbour is None or choose_orders):
        return fit
    found = [fit]
    other = _other_disturbance(estimation, fit)
    if other is not None:
        found.append(_search(estimation, fit.model, None, other, scale, rounds, True, None))
    if any(fit.problem.orders):
        # A whitening of few lags and a correlated disturbance explain much the same: try the simpler noise model.
        found.append(
            _search(estimation, fit.model, None, found[-1], scale, rounds, False, [0] * len(fit.problem.orders))
        )
    return max(found, key=lambda one: one.log_likelihood)


def _search(
    estimation: EstimationProblem,
    model: Model,
    starts: Sequence[Array] | None,
    neighbour: Refit | None,
    scale: Array | None,
    rounds: int,
    choose_orders: bool,
    orders: list[int] | None,
    limits: Disturbance = (MOST_EXPONENT, WALK),
    try_undisturbed: bool = False,
) -> Refit:
    """One search of `refit`, which may end in a local optimum of the disturbance."""
    criterion = estimation.criterion(model)
    if isinstance(criterion, InnovationCriterion):
        criterion.strongest, criterion.longest = limits
    lower, upper = model.bounds
    choices = [np.clip(s, lower, upper) for s in (starts or [model.theta])]
    k = len(choices[0])
    size = np.abs(choices[0]) if scale is None else np.maximum(np.abs(scale), 1e-12)
    size = np.where(size > 0.0, size, 1.0)
    problem = estimation.problem(criterion, k)
    if neighbour is not None and len(neighbour.nuisance) == len(criterion.nuisance()[0]):
        criterion.keep(neighbour.nuisance)
        if isinstance(criterion, SimulationCriterion):
            criterion.initial.scale = neighbour.criterion.initial.scale  # type: ignore[attr-defined]
    # Neighbours have the same whitening orders, so that their log-likelihoods compare.
    if orders is None and neighbour is not None and not choose_orders:
        orders = neighbour.problem.orders
    best, theta = -np.inf, choices[0]
    failure: Exception | None = None
    for choice in choices:
        try:
            value, disturbance = _start(criterion, problem, choice, orders, neighbour is None and len(choices) > 1)
        except (np.linalg.LinAlgError, IdloopError, ValueError) as error:
            failure = error
            continue
        if value > best:
            best, theta, start = value, choice, disturbance
    if not np.isfinite(best):
        if isinstance(failure, IdloopError):
            raise failure
        raise IdloopError("the model gives no finite output at its starting values; check signs and magnitudes")
    if try_undisturbed and isinstance(criterion, InnovationCriterion):
        value, undisturbed = _under_disturbance(criterion, problem, theta, (lower, upper), size, NO_DISTURBANCE, orders)
        if value > best:
            theta, start = undisturbed, np.array(NO_DISTURBANCE)
    criterion.keep(start)
    subset = criterion.subset(SUBSET_SAMPLES) if isinstance(criterion, InnovationCriterion) else None
    step: Array | None = None
    slopes = _slopes_of(neighbour, model) if neighbour is not None else None
    best, kept, settled = -np.inf, None, False
    for round_ in range(rounds):
        criterion.retune(theta)
        # The first round moves the parameters far, and with them the best disturbance.
        early = round_ < 2
        probes: Sequence[Disturbance] = (
            (COLD_START_GRID if neighbour is None else neighbouring_disturbances(criterion)) if early else ()
        )
        reach = FIRST_REACH if round_ == 0 else NEXT_REACH
        if early and subset is not None:
            probes, reach = (
                [tuned_on_subset(subset, estimation, criterion, theta, orders, probes, reach)],
                NEXT_REACH * round_,
            )
        value = fit_disturbance(criterion, problem, theta, orders, probes, reach)
        if value == -np.inf:
            break
        nuisance, low, high, nuisance_size = criterion.nuisance()
        held = nuisance if isinstance(criterion, InnovationCriterion) else nuisance[:0]
        moving = len(nuisance) - len(held)
        found = minimise(
            lambda at, held=held: problem.residual_or_infinite(np.concatenate([at, held])),  # type: ignore[misc]
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
        gained = value - neighbour.log_likelihood if neighbour is not None else 0.0
        if value < best + max(NEGLIGIBLE_GAIN, _SETTLED_PART * gained) and round_ > 0:
            settled = True
            break
        best = max(best, value)
    if kept is None:
        raise IdloopError("the search left the region in which the model can be simulated")
    theta, nuisance, step, approximate = kept
    criterion.keep(nuisance)
    criterion.retune(theta)
    point = np.concatenate([theta, nuisance])
    value = weigh(problem, point, orders)
    fitted = model.with_values(dict(zip(model.free, (float(v) for v in theta), strict=True)))
    if isinstance(criterion, InnovationCriterion):
        # The model file describes a random walk only.
        walks = criterion.memory >= LONG_MEMORY
        fitted = replace(fitted, disturbance=float(np.sqrt(criterion.intensity)) if walks else None)
    return Refit(fitted, criterion, problem, point, value, step, approximate, round_ + 1, settled)


def _from_model_without_effects(
    estimation: EstimationProblem, model: Model, fit: Refit, rounds: int, orders: list[int] | None, limits: Disturbance
) -> Refit:
    """The fit, or a better one that starts from the optimum of the model without its effects.

    While the plain model is far off, a search may move an effect to values at which it has no influence.
    """
    levels = {active.name: active.effect.strength or active.effect.from_a_level for active in model.effects}
    names = [f"{name}.{level}" for name, level in levels.items() if f"{name}.{level}" in model.free]
    if not names:
        return fit
    plain_model = model.without_effects(name.rpartition(".")[0] for name in names)
    try:
        plain = _search(estimation, plain_model, None, None, None, rounds, False, orders, limits)
        start = model.with_values(plain.model.values).theta
        choices = [start]
        for name in names:
            for share in STRENGTH_FACTORS:
                choices.append(start.copy())
                choices[-1][model.free.index(name)] *= share
        other = _search(estimation, model, choices, plain, None, rounds, True, orders, limits)
    except (IdloopError, np.linalg.LinAlgError):
        return fit
    return max(fit, other, key=lambda one: one.log_likelihood)


def _slopes_of(neighbour: Refit, model: Model) -> Array | None:
    """Jacobian of a neighbouring model in the order of this one's parameters; NaN for new ones."""
    if neighbour.slopes is None:
        return None
    places = {name: place for place, name in enumerate(neighbour.model.free)}
    slopes = np.full((len(neighbour.slopes), len(model.free)), np.nan)
    for column, name in enumerate(model.free):
        if name in places:
            slopes[:, column] = neighbour.slopes[:, places[name]]
    return slopes


def _other_disturbance(estimation: EstimationProblem, fit: Refit) -> Refit | None:
    """The fit with a disturbance from another local optimum, where that explains the errors better."""
    if not isinstance(fit.criterion, InnovationCriterion):
        return None
    theta = fit.point[: fit.parameters]
    found = other_disturbance(
        estimation, fit.model, theta, (float(fit.nuisance[0]), float(fit.nuisance[1])), fit.problem.orders
    )
    return None if found is None else replace(fit, point=np.append(theta, found))


def _or_none(fit: Callable[_Arguments, Refit]) -> Callable[_Arguments, Refit | None]:
    @wraps(fit)
    def or_none(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> Refit | None:
        try:
            return fit(*args, **kwargs)
        except (IdloopError, np.linalg.LinAlgError):
            return None

    return or_none


# As `refit`; None where the model cannot be simulated.
refit_or_none = _or_none(refit)


def transfer(estimation: EstimationProblem, fit: Refit, *, own_disturbance: bool = False) -> Refit | None:
    """A fitted model on other records, with its parameters and noise model.

    `estimation`: the other records.
    `own_disturbance`: fit the disturbance to the other records.
    Returns: None where the model cannot be simulated on them.
    """
    try:
        criterion = estimation.criterion(fit.model)
        theta = fit.model.theta
        if isinstance(criterion, InnovationCriterion):
            criterion.keep(fit.nuisance)
        criterion.retune(theta)
        start, low, high, size = criterion.nuisance()
        problem = estimation.problem(criterion, len(theta))
        point = np.concatenate([theta, start])
        if weigh(problem, point, fit.problem.orders) == -np.inf:
            return None
        if isinstance(criterion, InnovationCriterion):
            if own_disturbance:
                fit_disturbance(criterion, problem, theta, fit.problem.orders, (), FIRST_REACH)
                point = np.concatenate([theta, criterion.nuisance()[0]])
        elif len(start):
            # Initial states belong to the records, not to the model.
            found = minimise(
                lambda at: problem.residual_or_infinite(np.concatenate([theta, at]), frozen=True),
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
    criterion: Criterion, problem: LeastSquaresProblem, theta: Array, orders: list[int] | None, cold: bool
) -> tuple[float, Array]:
    """Log-likelihood at starting values, and the nuisance parameters there: the best of a few disturbances."""
    criterion.retune(theta)
    nuisance = criterion.nuisance()[0]
    tries = [nuisance]
    if isinstance(criterion, InnovationCriterion) and cold:
        tries = [np.array(at) for at in COLD_START_GRID]
    values = [weigh(problem, np.concatenate([theta, at]), orders) for at in tries]
    best = int(np.argmax(values))
    return values[best], tries[best]


def _under_disturbance(
    criterion: Criterion,
    problem: LeastSquaresProblem,
    theta: Array,
    bounds: tuple[Array, Array],
    size: Array,
    disturbance: Disturbance,
    orders: list[int] | None,
) -> tuple[float, Array]:
    """Largest log-likelihood under a given disturbance, and the parameters there."""
    try:
        criterion.retune(theta)
        if weigh(problem, np.append(theta, disturbance), orders) == -np.inf:
            return -np.inf, theta
        found = minimise(
            lambda at: problem.residual_or_infinite(np.append(at, disturbance)),
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
