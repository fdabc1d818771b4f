"""Maximum-likelihood refits of neighbouring models, all measured alike."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.setting import Setting
from idloop.errors import IdloopError
from idloop.estimate.criterion import Criterion
from idloop.estimate.innovations import LEAST_EXPONENT, MOST_EXPONENT, WALK, WHITE, InnovationCriterion
from idloop.estimate.levenberg import minimise
from idloop.estimate.problem import Problem
from idloop.estimate.simulation import SimulationCriterion
from idloop.estimate.translated import TranslatedCriterion
from idloop.physics.model import Model

Array = NDArray[np.float64]
Disturbance = tuple[float, float]

_MOST_ROUNDS = 10
_ITERATIONS_PER_ROUND = 6
# Gain in log-likelihood of one round below which the search ends, absolute and as part of what
# the model has gained on the one beside it: thousands need not be known to a hundredth.
_SETTLED, _SETTLED_PART = 0.05, 2e-4
# Where a cold start looks for the disturbance's intensity, in decades.
_MEMORIES = (WALK, 1.0, WHITE)
_COLD = tuple(itertools.product((-8.0, -6.0, -4.0, -2.0, 0.0, 2.0), _MEMORIES))
_NONE = (LEAST_EXPONENT, WHITE)
# Decades by which a missing effect that is added may weaken the disturbance.
_WEAKER = -2.0
# Change of the whitened errors, in all, below which a unit of a parameter, a typical change of a nuisance, is not felt.
_LEAST_SLOPE, _FELT = 1e-6, 0.1
# Parts of an effect's strength at which a search may start as well.
FAN = (0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.2, 1.4, 2.0, 2.8)
# How far from the present intensity the next ones are tried, how finely it ends, and how often [decades].
# In the first round of a search, and in those that follow.
_FAR, _NEAR, _FINEST, _FARTHEST, _MOST_PROBES = 0.8, 0.3, 0.1, 2.0, 10
# Rise of the log-likelihood to the top of a bowl at which the search for the disturbance ends, and how
# small the bowl must be to be one [decades].
_FLAT, _FINE = 0.05, 0.35
# Rise of the log-likelihood that is worth a longer step.
_UPHILL = 0.01
# How often the innovations are translated anew from where a search for the disturbance has led, and the
# part of a promised rise by which the model itself may miss it before the translation is given up for good,
# and by which it may be off and still be the last word.
_TRANSLATIONS, _FAITHLESS, _EXACT = 4, 0.7, 0.02
# Samples of long records that the first rounds look at to find the disturbance roughly.
_GLIMPSE = 10_000
# Decades of samples from which on a disturbance passes for a random walk.
LONG_MEMORY = 2.0
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
    """

    model: Model
    criterion: Criterion
    problem: Problem
    point: Array
    log_likelihood: float
    step: Array
    slopes: NDArray[np.float32] | None = None

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

    @property
    def coloured(self) -> float:
        """What the whitening explains of the errors: log of the ratio of deviations, the most of all groups."""
        found = 0.0
        for group, weight in zip(self.problem.errors(self.point), self.problem.weights, strict=True):
            raw = np.concatenate(group) @ weight.T
            sign, log_determinant = np.linalg.slogdet(raw.T @ raw / len(raw))
            found = max(found, float(0.5 * log_determinant / len(weight)) if sign > 0 else 0.0)
        return found

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


def log_likelihood(problem: Problem) -> float:
    """Concentrated log-likelihood of a problem at the point at which it has just been weighed."""
    value = 0.0
    for instants, order, weight in zip(problem.instants, problem.orders, problem.weights, strict=True):
        value += instants * float(np.sum(np.log(np.diag(weight)))) - order * len(weight) ** 2
    return value if np.isfinite(value) else -np.inf


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


def residual_or_infinite(problem: Problem, point: Array) -> Array:
    """Residual, infinite where the model cannot be simulated."""
    try:
        return problem.frozen_residual(point)
    except (IdloopError, np.linalg.LinAlgError):
        return np.full(problem.length, np.inf)


def _projected(problem: Problem, point: Array) -> Array:
    """Residual with the whitening at its best for the point, infinite where there is none."""
    try:
        return problem.residual(point)
    except (IdloopError, np.linalg.LinAlgError):
        return np.full(problem.length, np.inf)


def _weigh(problem: Problem, point: Array, orders: list[int] | None = None) -> float:
    with np.errstate(all="ignore"):
        try:
            problem.reweigh(point, True, orders)
            return log_likelihood(problem)
        except (np.linalg.LinAlgError, IdloopError):
            return -np.inf


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

    Returns
    -------
    Refit

    Raises
    ------
    IdloopError
        The model gives no finite errors at any start.
    """
    fit = _search(setting, model, starts, beside, scale, rounds, reconsider, orders, limits, calm)
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
    for choice in choices:
        cold = beside is None and len(choices) > 1
        value, disturbance = _start(criterion, problem, choice, orders, cold)
        if value > best:
            best, theta, start = value, choice, disturbance
    if not np.isfinite(best):
        raise IdloopError("the model gives no finite output at its starting values; check signs and magnitudes")
    if calm and isinstance(criterion, InnovationCriterion):
        value, elsewhere = _without_disturbance(criterion, problem, theta, lower, upper, size, orders)
        if value > best:
            theta, start = elsewhere, np.array(_NONE)
    criterion.keep(start)
    glimpse = criterion.glimpse(_GLIMPSE) if isinstance(criterion, InnovationCriterion) else None
    step: Array | None = None
    slopes = _slopes_of(beside, model) if beside is not None else None
    best, kept = -np.inf, None
    for round_ in range(rounds):
        criterion.retune(theta)
        # The first round moves the parameters so far that its best disturbance need not be near the next.
        early = round_ < 2
        probes: Sequence[Disturbance] = (_COLD if beside is None else _aside(criterion)) if early else ()
        reach = _FAR if round_ == 0 else _NEAR
        if early and glimpse is not None:
            probes, reach = [_glimpsed(glimpse, setting, criterion, theta, orders, probes, reach)], _NEAR * round_
        value = _tune(criterion, problem, theta, orders, probes, reach)
        if value == -np.inf:
            break
        nuisance, low, high, nuisance_size = criterion.nuisance()
        held = nuisance if isinstance(criterion, InnovationCriterion) else nuisance[:0]
        moving = len(nuisance) - len(held)
        found = minimise(
            lambda at, held=held: _projected(problem, np.concatenate([at, held])),  # type: ignore[misc]
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
        value = max(value, _weigh(problem, np.concatenate([theta, nuisance]), orders))
        if value > best:
            steps = np.concatenate([step, nuisance_size[moving:] * 1e-4])
            kept = (theta, nuisance, steps, slopes[:, :k].astype(np.float32))
        gained = value - beside.log_likelihood if beside is not None else 0.0
        if value < best + max(_SETTLED, _SETTLED_PART * gained) and round_ > 0:
            break
        best = max(best, value)
    if kept is None:
        raise IdloopError("the search left the region in which the model can be simulated")
    theta, nuisance, step, rough = kept
    criterion.keep(nuisance)
    criterion.retune(theta)
    point = np.concatenate([theta, nuisance])
    value = _weigh(problem, point, orders)
    fitted = model.with_values(dict(zip(model.free, (float(v) for v in theta), strict=True)))
    if isinstance(criterion, InnovationCriterion):
        # What forgets quickly is no walk, which is what an observer elsewhere takes a disturbance for.
        walks = criterion.memory >= LONG_MEMORY
        fitted = replace(fitted, disturbance=float(np.sqrt(criterion.intensity)) if walks else None)
    return Refit(fitted, criterion, problem, point, value, step, rough)


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
    plain_model = model
    for name in names:
        plain_model = plain_model.without_effect(name.rpartition(".")[0])
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


def refit_or_none(
    setting: Setting,
    model: Model,
    starts: Sequence[Array] | None = None,
    beside: Refit | None = None,
    scale: Array | None = None,
    rounds: int = _MOST_ROUNDS,
    calm: bool = False,
) -> Refit | None:
    """As `refit`; None where the model cannot be simulated."""
    try:
        return refit(setting, model, starts, beside, scale, rounds, calm=calm)
    except (IdloopError, np.linalg.LinAlgError):
        return None


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
        problem = setting.problem(criterion, len(theta))
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
) -> tuple[float, Array]:
    """Log-likelihood at a start, and the nuisance there: the best of a few disturbances."""
    try:
        criterion.retune(theta)
    except (np.linalg.LinAlgError, IdloopError, ValueError):
        return -np.inf, np.zeros(0)
    nuisance = criterion.nuisance()[0]
    tries = [nuisance]
    if isinstance(criterion, InnovationCriterion) and cold:
        tries = [np.array(at) for at in _COLD]
    values = [_weigh(problem, np.concatenate([theta, at]), orders) for at in tries]
    best = int(np.argmax(values))
    return values[best], tries[best]


def _without_disturbance(
    criterion: InnovationCriterion,
    problem: Problem,
    theta: Array,
    lower: Array,
    upper: Array,
    size: Array,
    orders: list[int] | None,
) -> tuple[float, Array]:
    """Log-likelihood and parameters at which the model is best without any disturbance."""
    try:
        criterion.retune(theta)
        if _weigh(problem, np.append(theta, _NONE), orders) == -np.inf:
            return -np.inf, theta
        found = minimise(
            lambda at: _projected(problem, np.append(at, _NONE)),
            theta,
            lower,
            upper,
            np.maximum(np.abs(theta), 1e-3 * size),
            max_iterations=2 * _ITERATIONS_PER_ROUND,
            tolerance=_PROMISE,
            quick=True,
        ).point
        criterion.retune(found)
        return _weigh(problem, np.append(found, _NONE), orders), found
    except (IdloopError, np.linalg.LinAlgError):
        return -np.inf, theta


def _tune(
    criterion: Criterion,
    problem: Problem,
    theta: Array,
    orders: list[int] | None,
    probes: Sequence[Disturbance],
    reach: float,
) -> float:
    """Set the disturbance's intensity and memory, with the whitening at its best for each, and weigh the errors.

    Disturbance and whitening explain much the same: searched one after the other they crawl. The search
    itself looks at translated innovations; where it ends, the model is run, and the search goes on from there.
    """
    nuisance = criterion.nuisance()[0]
    here = _weigh(problem, np.concatenate([theta, nuisance]), orders)
    if not isinstance(criterion, InnovationCriterion):
        return here
    at = criterion.exponent, criterion.memory
    for _ in range(_TRANSLATIONS if criterion.translates else 0):
        try:
            near = Problem(
                TranslatedCriterion(criterion, theta, np.array(at)), len(theta), problem.given, problem.floors
            )
        except (np.linalg.LinAlgError, IdloopError):
            break
        there, promised = _climb(near, theta, orders, at, probes, reach)
        still = there == at
        if still:
            if not criterion.engine.model.effects:
                break
            # Nothing better is in sight; is the sight good?
            there = at[0] + (_NEAR if at[0] + _NEAR <= criterion.strongest else -_NEAR), at[1]
            promised = _weigh(near, np.append(theta, there), orders) - _weigh(near, np.append(theta, at), orders)
        value = _weigh(problem, np.append(theta, there), orders)
        missed = abs(value - here - promised)
        if value > here:
            at, here, probes, reach = there, value, (), _NEAR
        if not missed <= _FAITHLESS * abs(promised) + _FLAT:
            criterion.translates = False
            break
        if still or missed <= _EXACT * abs(promised) + _FLAT:
            break
    if not criterion.translates:
        at, _ = _climb(problem, theta, orders, at, probes, reach)
    criterion.exponent, criterion.memory = at
    return _weigh(problem, np.append(theta, at), orders)


def _climb(
    problem: Problem,
    theta: Array,
    orders: list[int] | None,
    start: Disturbance,
    probes: Sequence[Disturbance],
    reach: float,
) -> tuple[Disturbance, float]:
    """The disturbance at which the log-likelihood is largest, and how much larger than at the start."""
    _, low, high, _ = problem.criterion.nuisance()
    known: dict[Disturbance, float] = {}

    def value(exponent: float, memory: float) -> float:
        at = float(np.clip(exponent, low[0], high[0])), float(np.clip(memory, low[1], high[1]))
        if at not in known:
            known[at] = _weigh(problem, np.append(theta, at), orders)
        return known[at]

    before = value(*start)
    for at in probes:
        value(*at)
    best = max(known, key=known.__getitem__)
    for _ in range(_MOST_PROBES):
        here = best
        for place in range(2):
            for sign in (-1.0, 1.0):
                at = (best[0] + sign * reach, best[1]) if place == 0 else (best[0], best[1] + sign * reach)
                if value(*at) > known[best]:
                    break  # the other way lies lower
            best = max(known, key=known.__getitem__)
        if known[best] > known[here] + _UPHILL:
            reach = min(2.0 * reach, _FARTHEST)
            continue
        # Intensity and memory go together along a ridge: only a bowl through all neighbours shows its way.
        value(best[0] + reach, best[1] + reach)
        if all(known[best] - other < 2.0 * _FLAT for other in _around(known, best, reach)):
            break
        value(*_vertex(known, best, reach))
        best = max(known, key=known.__getitem__)
        flat = reach < _FINE and known[best] < known[here] + _FLAT
        reach *= 0.4
        if flat or reach < _FINEST:
            break
    return best, known[best] - before


def _disturbance_elsewhere(setting: Setting, fit: Refit) -> Refit | None:
    """The same model with another disturbance altogether, where that explains its errors better.

    What is nearly white and strong, and what is nearly a walk and weak, may both be best among their like.
    """
    full = setting.criterion(fit.model)
    if not isinstance(full, InnovationCriterion):
        return None
    theta, orders = fit.point[: fit.parameters], fit.problem.orders
    criterion = full.glimpse(_GLIMPSE) or full
    criterion.retune(theta)
    problem = setting.problem(criterion, len(theta))
    here = float(fit.nuisance[0]), float(fit.nuisance[1])
    found: dict[Disturbance, float] = {}
    for memory in _MEMORIES:
        grid = {at: _weigh(problem, np.append(theta, at), orders) for at in _COLD if at[1] == memory}
        criterion.keep(np.array(max(grid, key=grid.__getitem__)))
        value = _tune(criterion, problem, theta, orders, (), _FAR)
        found[criterion.exponent, criterion.memory] = value
    criterion.keep(np.array(here))
    value = _tune(criterion, problem, theta, orders, (), _NEAR)
    found[criterion.exponent, criterion.memory] = value
    best = max(found, key=found.__getitem__)
    near = [found[at] for at in found if max(abs(a - b) for a, b in zip(at, here, strict=True)) < _FAR]
    if near and found[best] <= max(near) + _SETTLED:
        return None
    return replace(fit, point=np.append(theta, best))


def _glimpsed(
    glimpse: InnovationCriterion,
    setting: Setting,
    criterion: Criterion,
    theta: Array,
    orders: list[int] | None,
    probes: Sequence[Disturbance],
    reach: float,
) -> Disturbance:
    """The disturbance that suits a part of the data."""
    glimpse.keep(criterion.nuisance()[0])
    glimpse.retune(theta)
    problem = setting.problem(glimpse, len(theta))
    _tune(glimpse, problem, theta, orders, probes, reach)
    return glimpse.exponent, glimpse.memory


def _aside(criterion: Criterion) -> list[Disturbance]:
    """Disturbances that are weaker, or that forget sooner or later, than the present one."""
    if not isinstance(criterion, InnovationCriterion):
        return []
    here = criterion.exponent
    return [(here + _WEAKER, criterion.memory), *((here, memory) for memory in _MEMORIES)]


def _around(known: Mapping[Disturbance, float], best: Disturbance, reach: float) -> list[float]:
    """Values beside the best point and at one corner; what is out of range is left out."""
    beside = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1))
    places = [(best[0] + first * reach, best[1] + second * reach) for first, second in beside]
    return [known[at] for at in places if at in known]


def _vertex(known: Mapping[Disturbance, float], best: Disturbance, reach: float) -> Disturbance:
    """Where the bowl through the best point, those beside it and one corner is highest, within twice the reach."""

    def beside(first: float, second: float) -> float:
        return known.get((best[0] + first * reach, best[1] + second * reach), -np.inf) - known[best]

    east, west, north, south, corner = beside(1, 0), beside(-1, 0), beside(0, 1), beside(0, -1), beside(1, 1)
    slope = 0.5 * np.array([east - west, north - south])
    cross = corner - east - north
    bend = np.array([[east + west, cross], [cross, north + south]])
    if not np.all(np.isfinite(bend)) or bend[0, 0] >= 0.0 or np.linalg.det(bend) <= 0.0:
        return best
    move = np.clip(-np.linalg.solve(bend, slope), -2.0, 2.0) * reach
    return best[0] + float(move[0]), best[1] + float(move[1])
