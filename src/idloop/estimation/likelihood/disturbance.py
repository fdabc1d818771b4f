"""Maximum-likelihood intensity and memory of a model's disturbance force, together with the whitening."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.log_likelihood import weigh
from idloop.estimation.observer.innovations import LEAST_EXPONENT, MOST_EXPONENT, WALK, WHITE, InnovationCriterion
from idloop.estimation.observer.translated_innovations import TranslatedCriterion
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.physics.model import Model

# Intensity and memory (correlation time in samples), both in decades.
Disturbance = tuple[float, float]

# Disturbances that are tried without any knowledge.
_MEMORIES = (WALK, 1.0, WHITE)
COLD_START_GRID = tuple(itertools.product((-8.0, -6.0, -4.0, -2.0, 0.0, 2.0), _MEMORIES))
NO_DISTURBANCE = (LEAST_EXPONENT, WHITE)
# Decades by which a missing effect, once added, may weaken the disturbance.
_WEAKER = -2.0
# Step of the search in the first round and in later ones, smallest and largest step [decades], and most steps.
FIRST_REACH, NEXT_REACH, _FINEST, _FARTHEST, _MOST_PROBES = 0.8, 0.3, 0.1, 2.0, 10
# The search ends when the log-likelihood rises less than this to the maximum, with a step below so many decades.
_FLAT, _FINE = 0.05, 0.35
# Rise of the log-likelihood after which the step is doubled.
_UPHILL = 0.01
# Most translations of the innovations in one search; the part of the predicted rise by which the actual one may differ
# before translation is given up, and below which the search ends.
_TRANSLATIONS, _UNFAITHFUL, _EXACT = 4, 0.7, 0.02
# Samples of long records with which the first rounds find the disturbance approximately.
SUBSET_SAMPLES = 10_000
# Gain of log-likelihood that is negligible.
NEGLIGIBLE_GAIN = 0.05
# Decades of samples from which on a disturbance counts as a random walk.
LONG_MEMORY = 2.0


def fit_disturbance(
    criterion: Criterion,
    problem: LeastSquaresProblem,
    theta: Array,
    orders: list[int] | None,
    probes: Sequence[Disturbance],
    reach: float,
) -> float:
    """Fit the disturbance at given parameters, with the best whitening for each; returns the log-likelihood.

    Disturbance and whitening explain much the same, so that alternating between them converges slowly. The search uses
    translated innovations; at its end the model is simulated, and the search continues from there.

    `criterion`: keeps the result; one without a disturbance is only weighed.
    `problem`: of this criterion; keeps the noise model.
    `theta` (k,): free parameters of the model.
    `orders`: whitening orders, one for each group of outputs; None chooses them.
    `probes`: further starting values.
    `reach`: first step [decades].
    """
    nuisance = criterion.nuisance()[0]
    here = weigh(problem, np.concatenate([theta, nuisance]), orders)
    if not isinstance(criterion, InnovationCriterion):
        return here
    at = criterion.exponent, criterion.memory
    for _ in range(_TRANSLATIONS if criterion.translates else 0):
        try:
            near = LeastSquaresProblem(
                TranslatedCriterion(criterion, theta, np.array(at)), len(theta), problem.given, problem.floors
            )
        except (np.linalg.LinAlgError, IdloopError):
            break
        there, promised = _maximise(near, theta, orders, at, probes, reach)
        still = there == at
        if still:
            if not criterion.engine.model.effects:
                break
            # The translation shows nothing better: check it by one simulation.
            there = at[0] + (NEXT_REACH if at[0] + NEXT_REACH <= criterion.strongest else -NEXT_REACH), at[1]
            promised = weigh(near, np.append(theta, there), orders) - weigh(near, np.append(theta, at), orders)
        value = weigh(problem, np.append(theta, there), orders)
        missed = abs(value - here - promised)
        if value > here:
            at, here, probes, reach = there, value, (), NEXT_REACH
        if not missed <= _UNFAITHFUL * abs(promised) + _FLAT:
            criterion.translates = False
            break
        if still or missed <= _EXACT * abs(promised) + _FLAT:
            break
    if not criterion.translates:
        at, _ = _maximise(problem, theta, orders, at, probes, reach)
    criterion.exponent, criterion.memory = at
    return weigh(problem, np.append(theta, at), orders)


def other_disturbance(
    estimation: EstimationProblem, model: Model, theta: Array, here: Disturbance, orders: list[int] | None
) -> Disturbance | None:
    """A likelier disturbance at another local optimum; None where there is none.

    A strong, nearly white disturbance and a weak random walk may both be local optima.

    `theta` (k,): free parameters of the model.
    `here`: the present one.
    `orders`: whitening orders.
    """
    full = estimation.criterion(model)
    if not isinstance(full, InnovationCriterion):
        return None
    criterion = full.subset(SUBSET_SAMPLES) or full
    criterion.retune(theta)
    problem = estimation.problem(criterion, len(theta))
    found: dict[Disturbance, float] = {}
    for memory in _MEMORIES:
        grid = {at: weigh(problem, np.append(theta, at), orders) for at in COLD_START_GRID if at[1] == memory}
        criterion.keep(np.array(max(grid, key=grid.__getitem__)))
        value = fit_disturbance(criterion, problem, theta, orders, (), FIRST_REACH)
        found[criterion.exponent, criterion.memory] = value
    criterion.keep(np.array(here))
    value = fit_disturbance(criterion, problem, theta, orders, (), NEXT_REACH)
    found[criterion.exponent, criterion.memory] = value
    best = max(found, key=found.__getitem__)
    near = [found[at] for at in found if max(abs(a - b) for a, b in zip(at, here, strict=True)) < FIRST_REACH]
    if near and found[best] <= max(near) + NEGLIGIBLE_GAIN:
        return None
    return best


def tuned_on_subset(
    subset: InnovationCriterion,
    estimation: EstimationProblem,
    criterion: Criterion,
    theta: Array,
    orders: list[int] | None,
    probes: Sequence[Disturbance],
    reach: float,
) -> Disturbance:
    """As `fit_disturbance`, from a part of the data; returns the disturbance."""
    subset.keep(criterion.nuisance()[0])
    subset.retune(theta)
    problem = estimation.problem(subset, len(theta))
    fit_disturbance(subset, problem, theta, orders, probes, reach)
    return subset.exponent, subset.memory


def fit_random_walk(criterion: InnovationCriterion, theta: Array, *, whiten: bool) -> float:
    """Intensity of the random-walk disturbance that explains the innovations of a known model best [decades].

    `criterion`: keeps the disturbance.
    `theta` (k,): free parameters of the model.
    `whiten`: compare what autoregressions of suitable order leave of the innovations, not the innovations themselves.
    Raises IdloopError: no observer can be designed for this model and data.
    """
    criterion.retune(theta)
    problem = LeastSquaresProblem(criterion, len(theta))
    orders = None if whiten else [0] * len(criterion.groups)
    known: dict[float, float] = {}

    def value(exponent: float) -> float:
        if exponent not in known:
            known[exponent] = weigh(problem, np.append(theta, (exponent, WALK)), orders)
        return known[exponent]

    best = max(map(float, np.arange(LEAST_EXPONENT, MOST_EXPONENT + 1.0, 2.0)), key=value)
    for step in (1.0, 0.5, 0.25):
        best = max((best, best - step, best + step), key=value)
    if value(best) == -np.inf:
        raise IdloopError("no observer could be designed for this model and data; try the simulation criterion")
    criterion.keep(np.array([best, WALK]))
    return criterion.exponent


def neighbouring_disturbances(criterion: Criterion) -> list[Disturbance]:
    """Disturbances that are weaker, or of shorter or longer memory, than the present one."""
    if not isinstance(criterion, InnovationCriterion):
        return []
    here = criterion.exponent
    return [(here + _WEAKER, criterion.memory), *((here, memory) for memory in _MEMORIES)]


def _maximise(
    problem: LeastSquaresProblem,
    theta: Array,
    orders: list[int] | None,
    start: Disturbance,
    probes: Sequence[Disturbance],
    reach: float,
) -> tuple[Disturbance, float]:
    """Disturbance of the largest log-likelihood, and the gain over the start: pattern search with a quadratic model."""
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
                    break  # the opposite step is worse
            best = max(known, key=known.__getitem__)
        if known[best] > known[here] + _UPHILL:
            reach = min(2.0 * reach, _FARTHEST)
            continue
        # Intensity and memory are correlated: the quadratic model needs a diagonal neighbour as well.
        value(best[0] + reach, best[1] + reach)
        if all(known[best] - other < 2.0 * _FLAT for other in _neighbours(known, best, reach)):
            break
        value(*_quadratic_maximum(known, best, reach))
        best = max(known, key=known.__getitem__)
        flat = reach < _FINE and known[best] < known[here] + _FLAT
        reach *= 0.4
        if flat or reach < _FINEST:
            break
    return best, known[best] - before


def _neighbours(known: Mapping[Disturbance, float], best: Disturbance, reach: float) -> list[float]:
    """Log-likelihoods one step from the best point and at one diagonal; those out of range are left out."""
    offsets = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1))
    places = [(best[0] + first * reach, best[1] + second * reach) for first, second in offsets]
    return [known[at] for at in places if at in known]


def _quadratic_maximum(known: Mapping[Disturbance, float], best: Disturbance, reach: float) -> Disturbance:
    """Maximum of the quadratic model through the best point and its neighbours, within twice the reach."""

    def gain(first: float, second: float) -> float:
        return known.get((best[0] + first * reach, best[1] + second * reach), -np.inf) - known[best]

    east, west, north, south, corner = gain(1, 0), gain(-1, 0), gain(0, 1), gain(0, -1), gain(1, 1)
    slope = 0.5 * np.array([east - west, north - south])
    cross = corner - east - north
    bend = np.array([[east + west, cross], [cross, north + south]])
    if not np.all(np.isfinite(bend)) or bend[0, 0] >= 0.0 or np.linalg.det(bend) <= 0.0:
        return best
    move = np.clip(-np.linalg.solve(bend, slope), -2.0, 2.0) * reach
    return best[0] + float(move[0]), best[1] + float(move[1])
