"""Searches for effects that no small step leads to.

A score test asks what a weak effect would do to the errors. What has no strength has no weak form, and it may change
the model so much that the values found without it, a gain close to zero for one, say nothing about those with it. It
is therefore fitted from the values that the user gave as well, and beside each of the effects that promise most with
it. A coupling that slips all the time looks to a linear model like a damper without a spring: where the fit has left
the user's machine far behind, effects are tried from near there as well (`idloop.diagnose.anchor`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from idloop.diagnose.anchor import from_near, left_behind
from idloop.diagnose.confirm import USUAL_REFITS, Confirmed, starts
from idloop.diagnose.ends import best_first, ends
from idloop.diagnose.follows import follows
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.screen import Screen, Screened
from idloop.errors import IdloopError
from idloop.estimate.likelihood.refit import Refit
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.model import Model

# Searches that are carried on after a first round.
_FINISHED = 4
# Starts around the user's values, and around those that a second effect was screened at; how far they scatter.
_FAR_STARTS, _WIDE, _NEAR_STARTS, _NEAR = 8, 1.0, 3, 0.5
# Standard deviations of the correlation of white errors with their neighbours from which on they are coloured.
_COLOURED = 4.0
# Ends of searches this close in log-likelihood are the same; so many different ones are kept.
_SAME, _MOST_BASES = 0.5, 3
# Part of the errors' power that an effect must change to be there at all.
_IDLE = 0.1
# Second effects that are searched for around their starts as well.
_THOROUGH = 3
# Choices of whole numbers, such as harmonics, that are searched for one effect.
_STRUCTURES = 2


def far_searches(
    setting: Setting, parent: Refit, start: Model, effects: Sequence[str] | None = None, seed: int = 0
) -> list[Confirmed]:
    """Fit effects without parameters, and others from near the user's values where the fit has left them.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    start : Model
        As the user gave it.
    effects : sequence of str, optional
        Choose from these only.
    seed : int

    Returns
    -------
    list of Confirmed
        Best first.
    """
    found: list[Confirmed] = []
    for proposal in proposals(parent.model, effects, setting.conditions):
        if not proposal.effect.parameters:
            found += _bases(setting, parent, proposal, start.values, seed)
    if left_behind(parent.model, start.values) or not follows(setting, parent):
        found += from_near(setting, parent, start.values, effects, seed)
    return sorted(found, key=lambda one: -one.gain)


def white(fit: Refit) -> bool:
    """Whether neighbouring errors have nothing in common, so that nothing is left to explain."""
    for group in fit.problem.whitened(fit.point):
        power = sum(np.sum(e**2, axis=0) for e in group)
        common = sum(np.sum(e[1:] * e[:-1], axis=0) for e in group)
        instants = sum(len(e) for e in group)
        if np.any(np.abs(common) > _COLOURED / np.sqrt(instants) * power):
            return False
    return True


def _bases(
    setting: Setting, parent: Refit, proposal: Proposal, given: Mapping[str, float], seed: int
) -> list[Confirmed]:
    """Where searches with an effect without parameters end, best first, without those where it does nothing."""
    model = proposal.model({})
    near = {**parent.model.values, **given}
    fits = ends(setting, model, [parent.model.values, near, *_scattered(near, model, _WIDE, _FAR_STARTS, seed)])
    found: list[Confirmed] = []
    for fit in fits:
        gain = fit.log_likelihood - parent.log_likelihood
        if all(abs(gain - other.gain) > _SAME for other in found) and _acts(setting, fit, proposal.name):
            found.append(Confirmed(proposal, fit, gain, 0.0))
    return found[:_MOST_BASES]


def _acts(setting: Setting, fit: Refit, name: str) -> bool:
    """Whether a model's errors are others with an effect than without it, all values alike."""
    try:
        without = setting.criterion(fit.model.without_effect(name))
        without.keep(fit.nuisance)
        before = without.errors(fit.point[: fit.parameters], fit.nuisance)
    except (IdloopError, np.linalg.LinAlgError):
        return True
    pairs = [
        (a, b)
        for one, other in zip(before, fit.problem.errors(fit.point), strict=True)
        for a, b in zip(one, other, strict=True)
    ]
    change, power = sum(float(np.sum((a - b) ** 2)) for a, b in pairs), sum(float(np.sum(b**2)) for _, b in pairs)
    return not change < _IDLE * power


def _scattered(
    values: Mapping[str, float], model: Model, spread: float, count: int, seed: int
) -> list[Mapping[str, float]]:
    """The same values with the free ones multiplied by anything about as far as e to the spread, up and down."""
    generator = np.random.default_rng(seed)
    return [
        {**values, **{name: values[name] * float(np.exp(spread * generator.normal())) for name in model.free}}
        for _ in range(count)
    ]


def beside_bare(setting: Setting, base: Refit, effects: Sequence[str] | None, seed: int) -> list[Confirmed]:
    """Effects fitted beside one without parameters, best first.

    What the screening says of a model that is far off is little: all values that it tried are starts.

    Parameters
    ----------
    setting : Setting
    base : Refit
        With the one.
    effects : sequence of str, optional
        Choose from these only.
    seed : int

    Returns
    -------
    list of Confirmed
    """
    screened = Screen(setting, base, seed).all(proposals(base.model, effects, setting.conditions))
    ranked = sorted((s for s in screened if s.statistic > 0.0), key=lambda s: -s.statistic)[:USUAL_REFITS]
    found = []
    for s in ranked:
        searches = _searches(s, base)
        fits = best_first(fit for model, choices in searches for fit in ends(setting, model, choices, base, _FINISHED))
        if fits:
            first = Confirmed(s.proposal, fits[0], 0.0, s.statistic).refitted(fits[0], base)
            found.append((first, searches))
    found.sort(key=lambda pair: -pair[0].gain)
    for place, (first, searches) in enumerate(found[:_THOROUGH]):
        again = [first.fit]
        for model, choices in searches:
            around = [at for values in choices for at in _scattered(values, model, _NEAR, _NEAR_STARTS, seed)]
            again += ends(setting, model, around, base, _FINISHED)
        fit = best_first(again)[0]
        found[place] = (first.refitted(fit, base), searches)
    return sorted((c for c, _ in found), key=lambda c: -c.gain)


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
    return list(groups.values())[:_STRUCTURES]
