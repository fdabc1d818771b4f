"""Non-local searches: for effects that no search from the fitted values reaches.

An effect without a strength has no weak form that a score test could show, and it may change the model so much that the
values fitted without it are far from its own. It is fitted from the nominal values as well, and beside each of the
effects that promise most with it.

Beside a dominant missing effect a likelihood may prefer a machine that its drive hardly moves (an inertia a hundred
times too large, a gain near zero) and a disturbance that explains the motion. From there no effect promises much. The
nominal values are of the right size: restarted near them, the model is worse and shows what it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

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
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.physics.effect import COUPLING, INPUT
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter
from idloop.physics.schema import BODY_PARAMETERS, COUPLING_PARAMETERS
from idloop.records import Record

# An inertia, a stiffness or a gain that the fit has changed by this factor is far from nominal.
_FAR = 5.0
# Searches that are continued, of those that began.
_CONTINUED = 3


def non_local_searches(
    estimation: EstimationProblem, parent: Refit, start: Model, effects: Sequence[str] | None = None, seed: int = 0,
    *, responds: bool = True,
) -> list[Confirmed]:  # fmt: skip
    """Fit effects without parameters, and others from near the nominal values where the fit is far from them.

    So it is where the motion does not respond to the command. Best first; `start` is the nominal model, as the user
    gave it.
    """
    found: list[Confirmed] = []
    for proposal in proposals(parent.model, effects, estimation.conditions):
        if not proposal.effect.parameters:
            found += _without_parameters(estimation, parent, proposal, start.values, seed)
    if far_from_nominal(parent.model, start.values) or not responds:
        found += _restarted_near_nominal(estimation, parent, start.values, effects, seed)
    return by_gain(found)


def from_trial_values(model: Model, records: Sequence[Record]) -> Model:
    """The model with values to start from for its effects that begin without influence, such as an infinite stiffness.

    No slope leads away from there: of the values that the effect tries on the records, the likeliest after one round.
    """
    for active in model.effects:
        own = [name for name in model.free if name.startswith(f"{active.name}.")]
        if all(math.isfinite(model.values[name]) for name in own):
            continue
        plain = model.without_effect(active.name)
        estimation = prepare_estimation(plain, records, "prediction")
        found = [one for one in proposals(plain, [active.effect.name], estimation.conditions) if one.at == active.at]
        scales = Sizes(plain, estimation).at(active.effect.site, active.at)
        trials = [trial for one in found for alternative in one.alternatives(scales) for trial in alternative]
        choices = [{name: trial.get(name.rpartition(".")[2], model.values[name]) for name in own} for trial in trials]
        for fit in _searched(estimation, model, choices, most=1):
            model = model.with_values({name: fit.model.values[name] for name in own})
    return model


def whitened(fit: Refit) -> bool:
    """Whether neighbouring errors are uncorrelated, so that nothing remains to be explained."""
    for group in fit.problem.whitened(fit.point):
        power = sum(np.sum(e**2, axis=0) for e in group)
        common = sum(np.sum(e[1:] * e[:-1], axis=0) for e in group)
        # Four standard deviations of the correlation of white errors.
        if np.any(np.abs(common) > 4.0 / np.sqrt(sum(len(e) for e in group)) * power):
            return False
    return True


def candidates_beside(
    estimation: EstimationProblem, base: Refit, effects: Sequence[str] | None, seed: int
) -> list[Confirmed]:
    """Effects fitted beside the one without parameters that a model has, best first, from all trial values."""
    screened = Screen(estimation, base, seed).all(proposals(base.model, effects, estimation.conditions))
    found = []
    for s in ranked_by_score(screened)[:USUAL_REFITS]:
        searches = _searches(s, base)
        fits = _best_first(fit for model, choices in searches for fit in _searched(estimation, model, choices, base, 4))
        if fits:
            first = Confirmed(s.proposal, fits[0], 0.0, s.statistic).refitted(fits[0], base)
            found.append((first, searches))
    found.sort(key=lambda pair: -pair[0].gain)
    for place, (first, searches) in enumerate(found[:_CONTINUED]):
        again = [first.fit]
        for model, choices in searches:
            around = [at for values in choices for at in _random_starts(values, model, 0.5, 3, seed)]
            again += _searched(estimation, model, around, base, 4)
        found[place] = (first.refitted(_best_first(again)[0], base), searches)
    return by_gain([one for one, _ in found])


def far_from_nominal(model: Model, nominal: Mapping[str, float]) -> list[str]:
    """Free inertias and stiffnesses of a fitted model that are far from their nominal values."""
    shares = {name: model.values[name] / nominal[name] for name in _nominal(model, nominal, ("inertia", "stiffness"))}
    return [name for name, share in shares.items() if not 1.0 / _FAR < share < _FAR]


def _nominal(model: Model, nominal: Mapping[str, float], kinds: Sequence[str]) -> list[str]:
    """Free parameters of bodies and couplings of some kinds that have a nominal value."""
    return [
        name
        for name in model.free
        if "@" not in name and name.rpartition(".")[2] in kinds and nominal.get(name, 0.0) > 0.0
    ]


def _without_parameters(
    estimation: EstimationProblem, parent: Refit, proposal: Proposal, nominal: Mapping[str, float], seed: int
) -> list[Confirmed]:
    """Results of searches with an effect without parameters, best first, without those where it does nothing."""
    model = proposal.model({})
    near = {**parent.model.values, **nominal}
    found: list[Confirmed] = []
    for fit in _searched(estimation, model, [parent.model.values, near, *_random_starts(near, model, 1.0, 8, seed)]):
        gain = fit.log_likelihood - parent.log_likelihood
        # Results within half a unit of log-likelihood are the same.
        if all(abs(gain - other.gain) > 0.5 for other in found) and _acts(estimation, fit, proposal.name):
            found.append(Confirmed(proposal, fit, gain, 0.0))
    return found[:_CONTINUED]


def _acts(estimation: EstimationProblem, fit: Refit, name: str) -> bool:
    """Whether an effect changes a tenth of the errors' power, the other values held."""
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


def _random_starts(
    values: Mapping[str, float], model: Model, spread: float, count: int, seed: int
) -> list[Mapping[str, float]]:
    """The same values with log-normal factors of this spread on the free ones."""
    generator = np.random.default_rng(seed)
    return [
        {**values, **{name: values[name] * float(np.exp(spread * generator.normal())) for name in model.free}}
        for _ in range(count)
    ]


def _searches(screened: Screened, base: Refit) -> list[tuple[Model, list[Mapping[str, float]]]]:
    """Models and starts: one model for each choice of integer parameters, the first two."""
    proposal = screened.proposal
    groups: dict[tuple[float, ...], tuple[Model, list[Mapping[str, float]]]] = {}
    for trace in sorted(screened.traces, key=lambda t: -t.statistic):
        for trial in starts(proposal, trace):
            model = proposal.model(trial)
            own = {name: value for name, value in model.values.items() if name not in base.model.values}
            key = tuple(trial.get(name, 0.0) for name in proposal.whole_numbers)
            groups.setdefault(key, (model, []))[1].append({**base.model.values, **own})
    return list(groups.values())[:2]


def _restarted_near_nominal(
    estimation: EstimationProblem, parent: Refit, nominal: Mapping[str, float], effects: Sequence[str] | None, seed: int
) -> list[Confirmed]:
    """Effects fitted from the best model near the nominal values; their gain may be negative."""
    start = _fit_near_nominal(estimation, parent.model, nominal)
    if start is None:
        return []
    screened = Screen(estimation, start, seed).all(proposals(start.model, effects, estimation.conditions))
    chosen = promising(screened, 2.0 * math.log(max(len(screened), 1)))
    for s in screened:
        effect = s.proposal.effect
        # A score is unreliable for an effect that begins at a level, a joint far from its stiffness, and a long delay.
        unreliable = effect.site == COUPLING or effect.from_a_level or effect.delay
        if unreliable and s.proposal.replaces is None and s.traces and s not in chosen:
            chosen.append(s)
    # A search that is still worse than the fit after the first round is not continued.
    found = confirm(estimation, start, chosen, matters=lambda c: c.fit.log_likelihood > parent.log_likelihood)
    if all(c.fit.log_likelihood <= parent.log_likelihood for c in found):
        for proposal in proposals(parent.model, effects, estimation.conditions):
            found += _restarted_at_nominal(estimation, parent, proposal, nominal)
    return [replace(c, gain=c.fit.log_likelihood - parent.log_likelihood) for c in found]


def _fit_near_nominal(estimation: EstimationProblem, model: Model, nominal: Mapping[str, float]) -> Refit | None:
    """The best model within a factor of three of the nominal values; free to leave them again."""
    names = _nominal(model, nominal, (*BODY_PARAMETERS, *COUPLING_PARAMETERS))
    if "drive.gain" in model.free and nominal.get("drive.gain", 0.0) != 0.0:
        names.append("drive.gain")
    start = model.with_values({name: nominal[name] for name in names})

    def near(parameter: Parameter) -> Parameter:
        low, high = sorted((nominal[parameter.name] / 3.0, nominal[parameter.name] * 3.0))
        return replace(parameter, min=max(parameter.min, low), max=min(parameter.max, high))

    held = tuple(near(p) if p.name in names else p for p in start.parameters)
    fit = refit_or_none(estimation, replace(start, parameters=held))
    return None if fit is None else replace(fit, model=model.with_values(fit.model.values))


def _restarted_at_nominal(
    estimation: EstimationProblem, parent: Refit, proposal: Proposal, nominal: Mapping[str, float]
) -> list[Confirmed]:
    """The best search that starts at the nominal values, with an effect without which these cannot be reached.

    Without its slip a coupling that always slips is far from its nominal stiffness; without its delay a late drive is
    far from its nominal gain.
    """
    model, effect, gain = parent.model, proposal.effect, "drive.gain"
    if effect.site == COUPLING:
        needed = f"{proposal.at}.stiffness" in far_from_nominal(model, nominal)
    else:
        lost = gain in model.free and abs(model.values[gain]) < abs(nominal.get(gain, 0.0)) / _FAR
        needed = lost and (effect.site == INPUT or bool(effect.delay))
    if not needed or proposal.replaces is not None:
        return []
    near = {**model.values, **nominal}
    scales = Sizes(model.with_values(near), estimation).at(effect.site, proposal.at)
    trials = [trial for alternative in proposal.alternatives(scales) for trial in alternative]
    choices = [{**near, **{f"{proposal.name}.{name}": v for name, v in trial.items()}} for trial in trials]
    return [
        Confirmed(proposal, f, 0.0, 0.0) for f in _searched(estimation, proposal.model(trials[0]), choices, most=2)[:1]
    ]


def _searched(
    estimation: EstimationProblem,
    model: Model,
    choices: Sequence[Mapping[str, float]],
    beside: Refit | None = None,
    most: int | None = None,
) -> list[Refit]:
    """Results of separate searches from several starts, best first; after a first round at most `most` continue."""

    def search(values: Mapping[str, float], begun: Refit | None = None) -> Refit | None:
        theta = np.array([values.get(name, model.values[name]) for name in model.free])
        if begun is None:
            # The first round keeps the noise model.
            return refit_or_none(estimation, model, [theta], beside, rounds=1, near=True)
        return refit_or_none(estimation, model, [theta], begun, rounds=MORE_ROUNDS) or begun

    begun = _best_first(in_parallel(search, choices))[:most]
    return _best_first(in_parallel(lambda fit: search(fit.model.values, fit), begun))


def _best_first(fits: Iterable[Refit | None]) -> list[Refit]:
    """The fits by falling likelihood, without those that failed."""
    return sorted((fit for fit in fits if fit is not None), key=lambda fit: -fit.log_likelihood)
