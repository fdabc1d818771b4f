"""The disturbance that suits a model's innovations: its intensity and its memory, searched beside the whitening."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.likelihood.estimation_problem import Setting
from idloop.estimation.likelihood.weighing import weigh
from idloop.estimation.observer.innovations import LEAST_EXPONENT, WALK, WHITE, InnovationCriterion
from idloop.estimation.observer.translated_innovations import TranslatedCriterion
from idloop.estimation.optimisation.problem import Problem
from idloop.physics.model import Model

Array = NDArray[np.float64]
# Decades of its intensity, and of the samples for which it remembers.
Disturbance = tuple[float, float]

# Where a cold start looks for the disturbance's intensity, in decades.
_MEMORIES = (WALK, 1.0, WHITE)
COLD = tuple(itertools.product((-8.0, -6.0, -4.0, -2.0, 0.0, 2.0), _MEMORIES))
NONE = (LEAST_EXPONENT, WHITE)
# Decades by which a missing effect that is added may weaken the disturbance.
_WEAKER = -2.0
# How far from the present intensity the next ones are tried, how finely it ends, and how often [decades].
# In the first round of a search, and in those that follow.
FAR, NEAR, _FINEST, _FARTHEST, _MOST_PROBES = 0.8, 0.3, 0.1, 2.0, 10
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
GLIMPSE = 10_000
# Gain in log-likelihood that does not count.
SETTLED = 0.05
# Decades of samples from which on a disturbance passes for a random walk.
LONG_MEMORY = 2.0


def tune(
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

    Parameters
    ----------
    criterion : Criterion
        Keeps what is found; one without a disturbance is only weighed.
    problem : Problem
        Of this criterion; keeps the noise model.
    theta : array, shape (k,)
        Free parameters of the model.
    orders : list of int or None
        Orders of the whitening, one for each group of outputs; None chooses them.
    probes : sequence of Disturbance
        Where the search looks as well before it begins.
    reach : float
        How far from the present disturbance it tries first [decades].

    Returns
    -------
    float
        Log-likelihood.
    """
    nuisance = criterion.nuisance()[0]
    here = weigh(problem, np.concatenate([theta, nuisance]), orders)
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
            there = at[0] + (NEAR if at[0] + NEAR <= criterion.strongest else -NEAR), at[1]
            promised = weigh(near, np.append(theta, there), orders) - weigh(near, np.append(theta, at), orders)
        value = weigh(problem, np.append(theta, there), orders)
        missed = abs(value - here - promised)
        if value > here:
            at, here, probes, reach = there, value, (), NEAR
        if not missed <= _FAITHLESS * abs(promised) + _FLAT:
            criterion.translates = False
            break
        if still or missed <= _EXACT * abs(promised) + _FLAT:
            break
    if not criterion.translates:
        at, _ = _climb(problem, theta, orders, at, probes, reach)
    criterion.exponent, criterion.memory = at
    return weigh(problem, np.append(theta, at), orders)


def elsewhere(
    setting: Setting, model: Model, theta: Array, here: Disturbance, orders: list[int] | None
) -> Disturbance | None:
    """Another disturbance altogether, where that explains the errors better.

    What is nearly white and strong, and what is nearly a walk and weak, may both be best among their like.

    Parameters
    ----------
    setting : Setting
    model : Model
    theta : array, shape (k,)
        Free parameters of the model.
    here : Disturbance
        The present one.
    orders : list of int or None
        Orders of the whitening.

    Returns
    -------
    Disturbance or None
        None where none is better.
    """
    full = setting.criterion(model)
    if not isinstance(full, InnovationCriterion):
        return None
    criterion = full.glimpse(GLIMPSE) or full
    criterion.retune(theta)
    problem = setting.problem(criterion, len(theta))
    found: dict[Disturbance, float] = {}
    for memory in _MEMORIES:
        grid = {at: weigh(problem, np.append(theta, at), orders) for at in COLD if at[1] == memory}
        criterion.keep(np.array(max(grid, key=grid.__getitem__)))
        value = tune(criterion, problem, theta, orders, (), FAR)
        found[criterion.exponent, criterion.memory] = value
    criterion.keep(np.array(here))
    value = tune(criterion, problem, theta, orders, (), NEAR)
    found[criterion.exponent, criterion.memory] = value
    best = max(found, key=found.__getitem__)
    near = [found[at] for at in found if max(abs(a - b) for a, b in zip(at, here, strict=True)) < FAR]
    if near and found[best] <= max(near) + SETTLED:
        return None
    return best


def glimpsed(
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
    tune(glimpse, problem, theta, orders, probes, reach)
    return glimpse.exponent, glimpse.memory


def aside(criterion: Criterion) -> list[Disturbance]:
    """Disturbances that are weaker, or that forget sooner or later, than the present one."""
    if not isinstance(criterion, InnovationCriterion):
        return []
    here = criterion.exponent
    return [(here + _WEAKER, criterion.memory), *((here, memory) for memory in _MEMORIES)]


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
            known[at] = weigh(problem, np.append(theta, at), orders)
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
