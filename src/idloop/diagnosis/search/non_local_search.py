"""Searches for effects that no small step leads to.

A score test asks what a weak effect would do to the errors. What has no strength has no weak form, and it may change
the model so much that the values found without it, a gain close to zero for one, say nothing about those with it. It
is therefore fitted from the values that the user gave as well, and beside each of the effects that promise most with
it.

Beside a missing effect that rules the motion, a likelihood may prefer a machine that its drive hardly moves, a hundred
times too heavy or with a gain of nothing, and a disturbance that does everything. From there no effect promises much.
The user's own values are no truth, but they are of the right size: held near them, the model is worse by itself and
shows what it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnosis.screening.command_response import follows
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screen, Screened
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.diagnosis.search.confirm import (
    MORE_ROUNDS,
    USUAL_REFITS,
    Confirmed,
    by_gain,
    confirm,
    promising,
    ranked_by_score,
    starts,
)
from idloop.errors import IdloopError
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.physics.effect import COUPLING, INPUT
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter
from idloop.physics.schema import BODY_PARAMETERS, COUPLING_PARAMETERS

# A mass, a stiffness or a gain that the fit has changed by this factor is not the user's any more.
_LEFT_BEHIND = 5.0
# Models that are taken further, of those that began.
_TAKEN_FURTHER = 3


def far_searches(
    estimation: EstimationProblem, parent: Refit, start: Model, effects: Sequence[str] | None = None, seed: int = 0
) -> list[Confirmed]:
    """Fit effects without parameters, and others from near the user's values where the fit has left them, best first.

    `start` is the model as the user gave it.
    """
    found: list[Confirmed] = []
    for proposal in proposals(parent.model, effects, estimation.conditions):
        if not proposal.effect.parameters:
            found += _without_parameters(estimation, parent, proposal, start.values, seed)
    if left_behind(parent.model, start.values) or not follows(estimation, parent):
        found += _from_near(estimation, parent, start.values, effects, seed)
    return by_gain(found)


def white(fit: Refit) -> bool:
    """Whether neighbouring errors have nothing in common, so that nothing is left to explain."""
    for group in fit.problem.whitened(fit.point):
        power = sum(np.sum(e**2, axis=0) for e in group)
        common = sum(np.sum(e[1:] * e[:-1], axis=0) for e in group)
        # Four standard deviations of the correlation of white errors.
        if np.any(np.abs(common) > 4.0 / np.sqrt(sum(len(e) for e in group)) * power):
            return False
    return True


def beside_bare(
    estimation: EstimationProblem, base: Refit, effects: Sequence[str] | None, seed: int
) -> list[Confirmed]:
    """Effects fitted beside the one without parameters that a model has, best first.

    What the screening says of a model that is far off is little: all values that it tried are starts.
    """
    screened = Screen(estimation, base, seed).all(proposals(base.model, effects, estimation.conditions))
    found = []
    for s in ranked_by_score(screened)[:USUAL_REFITS]:
        searches = _searches(s, base)
        fits = _best_first(fit for model, choices in searches for fit in _ends(estimation, model, choices, base, 4))
        if fits:
            first = Confirmed(s.proposal, fits[0], 0.0, s.statistic).refitted(fits[0], base)
            found.append((first, searches))
    found.sort(key=lambda pair: -pair[0].gain)
    for place, (first, searches) in enumerate(found[:_TAKEN_FURTHER]):
        again = [first.fit]
        for model, choices in searches:
            around = [at for values in choices for at in _scattered(values, model, 0.5, 3, seed)]
            again += _ends(estimation, model, around, base, 4)
        found[place] = (first.refitted(_best_first(again)[0], base), searches)
    return by_gain([one for one, _ in found])


def left_behind(model: Model, given: Mapping[str, float]) -> list[str]:
    """Free inertias and stiffnesses of a fitted model that are far from what the user gave."""
    shares = {name: model.values[name] / given[name] for name in _given(model, given, ("inertia", "stiffness"))}
    return [name for name, share in shares.items() if not 1.0 / _LEFT_BEHIND < share < _LEFT_BEHIND]


def _given(model: Model, given: Mapping[str, float], kinds: Sequence[str]) -> list[str]:
    """Free parameters of bodies and couplings of some kinds whose value the user gave."""
    return [
        name
        for name in model.free
        if "@" not in name and name.rpartition(".")[2] in kinds and given.get(name, 0.0) > 0.0
    ]


def _without_parameters(
    estimation: EstimationProblem, parent: Refit, proposal: Proposal, given: Mapping[str, float], seed: int
) -> list[Confirmed]:
    """Where searches with an effect without parameters end, best first, without those where it does nothing."""
    model = proposal.model({})
    near = {**parent.model.values, **given}
    found: list[Confirmed] = []
    for fit in _ends(estimation, model, [parent.model.values, near, *_scattered(near, model, 1.0, 8, seed)]):
        gain = fit.log_likelihood - parent.log_likelihood
        # Ends of searches within half a unit of log-likelihood are the same.
        if all(abs(gain - other.gain) > 0.5 for other in found) and _acts(estimation, fit, proposal.name):
            found.append(Confirmed(proposal, fit, gain, 0.0))
    return found[:_TAKEN_FURTHER]


def _acts(estimation: EstimationProblem, fit: Refit, name: str) -> bool:
    """Whether an effect changes a tenth of the errors' power, all values alike."""
    try:
        without = estimation.criterion(fit.model.without_effect(name))
        without.keep(fit.nuisance)
        before = without.errors(fit.point[: fit.parameters], fit.nuisance)
    except (IdloopError, np.linalg.LinAlgError):
        return True
    change = power = 0.0
    for one, other in zip(before, fit.problem.errors(fit.point), strict=True):
        for a, b in zip(one, other, strict=True):
            change, power = change + float(np.sum((a - b) ** 2)), power + float(np.sum(b**2))
    return not change < 0.1 * power


def _scattered(
    values: Mapping[str, float], model: Model, spread: float, count: int, seed: int
) -> list[Mapping[str, float]]:
    """The same values with the free ones multiplied by anything about as far as e to the spread, up and down."""
    generator = np.random.default_rng(seed)
    return [
        {**values, **{name: values[name] * float(np.exp(spread * generator.normal())) for name in model.free}}
        for _ in range(count)
    ]


def _searches(screened: Screened, base: Refit) -> list[tuple[Model, list[Mapping[str, float]]]]:
    """Models and starts: one model for each choice of what a search cannot move, the first two."""
    proposal = screened.proposal
    whole = [spec.name for spec in proposal.effect.parameters if spec.integer]
    groups: dict[tuple[float, ...], tuple[Model, list[Mapping[str, float]]]] = {}
    for trace in sorted(screened.traces, key=lambda t: -t.statistic):
        for trial in starts(proposal, trace):
            model = proposal.model(trial)
            own = {name: value for name, value in model.values.items() if name not in base.model.values}
            key = tuple(trial.get(name, 0.0) for name in whole)
            groups.setdefault(key, (model, []))[1].append({**base.model.values, **own})
    return list(groups.values())[:2]


def _from_near(
    estimation: EstimationProblem, parent: Refit, given: Mapping[str, float], effects: Sequence[str] | None, seed: int
) -> list[Confirmed]:
    """Effects refitted from where the model is best near the user's values; their gain may be below 0."""
    start = _held_near(estimation, parent.model, given)
    if start is None:
        return []
    screened = Screen(estimation, start, seed).all(proposals(start.model, effects, estimation.conditions))
    chosen = promising(screened, 2.0 * math.log(max(len(screened), 1)))
    for s in screened:
        effect = s.proposal.effect
        # A score says little of what begins at a level, of a joint whose spring is far from its right stiffness, or of
        # a delay of many samples.
        strange = effect.site == COUPLING or effect.from_a_level or effect.delay
        if strange and s.proposal.replaces is None and s.traces and s not in chosen:
            chosen.append(s)
    # What is still behind the fit far away after a first round is not searched to its end.
    found = confirm(estimation, start, chosen, matters=lambda c: c.fit.log_likelihood > parent.log_likelihood)
    if all(c.fit.log_likelihood <= parent.log_likelihood for c in found):
        for proposal in proposals(parent.model, effects, estimation.conditions):
            found += _from_the_users(estimation, parent, proposal, given)
    return [replace(c, gain=c.fit.log_likelihood - parent.log_likelihood) for c in found]


def _held_near(estimation: EstimationProblem, model: Model, given: Mapping[str, float]) -> Refit | None:
    """The model at its best within a factor of three of the user's values; free to leave them again."""
    names = _given(model, given, (*BODY_PARAMETERS, *COUPLING_PARAMETERS))
    if "drive.gain" in model.free and given.get("drive.gain", 0.0) != 0.0:
        names.append("drive.gain")
    start = model.with_values({name: given[name] for name in names})

    def near(parameter: Parameter) -> Parameter:
        low, high = sorted((given[parameter.name] / 3.0, given[parameter.name] * 3.0))
        return replace(parameter, min=max(parameter.min, low), max=min(parameter.max, high))

    held = tuple(near(p) if p.name in names else p for p in start.parameters)
    fit = refit_or_none(estimation, replace(start, parameters=held))
    return None if fit is None else replace(fit, model=model.with_values(fit.model.values))


def _from_the_users(
    estimation: EstimationProblem, parent: Refit, proposal: Proposal, given: Mapping[str, float]
) -> list[Confirmed]:
    """Where the best search ends that starts from the very values of the user, with an effect that they need.

    A coupling that slips all the time is nowhere near the user's stiffness without its slip, nor is a drive that
    answers late near the user's gain without its delay.
    """
    model, effect, gain = parent.model, proposal.effect, "drive.gain"
    if effect.site == COUPLING:
        needed = f"{proposal.at}.stiffness" in left_behind(model, given)
    else:
        lost = gain in model.free and abs(model.values[gain]) < abs(given.get(gain, 0.0)) / _LEFT_BEHIND
        needed = lost and (effect.site == INPUT or bool(effect.delay))
    if not needed or proposal.replaces is not None:
        return []
    near = {**model.values, **given}
    scales = Sizes(model.with_values(near), estimation).at(effect.site, proposal.at)
    trials = [trial for alternative in proposal.alternatives(scales) for trial in alternative]
    choices = [{**near, **{f"{proposal.name}.{name}": v for name, v in trial.items()}} for trial in trials]
    return [Confirmed(proposal, f, 0.0, 0.0) for f in _ends(estimation, proposal.model(trials[0]), choices, most=2)[:1]]


def _ends(
    estimation: EstimationProblem,
    model: Model,
    choices: Sequence[Mapping[str, float]],
    beside: Refit | None = None,
    most: int | None = None,
) -> list[Refit]:
    """Where searches from several starts end, each by itself, best first: the nearest start need not lead to the best.

    After a first round no more than `most` are carried on.
    """

    def search(values: Mapping[str, float], begun: Refit | None = None) -> Refit | None:
        theta = np.array([values.get(name, model.values[name]) for name in model.free])
        if begun is None:
            # A first round tells which starts lead anywhere: it need not look for another noise.
            return refit_or_none(estimation, model, [theta], beside, rounds=1, near=True)
        return refit_or_none(estimation, model, [theta], begun, rounds=MORE_ROUNDS) or begun

    begun = _best_first(in_parallel(search, choices))[:most]
    return _best_first(in_parallel(lambda fit: search(fit.model.values, fit), begun))


def _best_first(fits: Iterable[Refit | None]) -> list[Refit]:
    """The fits by falling likelihood, without those that failed."""
    return sorted((fit for fit in fits if fit is not None), key=lambda fit: -fit.log_likelihood)
