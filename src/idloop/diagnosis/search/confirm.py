"""Fits of the most promising effects, from several starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.options import Progress, silent
from idloop.diagnosis.screening.proposals import Proposal
from idloop.diagnosis.screening.score_test import Screened, Trace
from idloop.errors import IdloopError
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import STRENGTH_FACTORS, Refit, refit, refit_or_none
from idloop.estimation.observer.innovations import WALK
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter
from idloop.physics.trial import Trial

Array = NDArray[np.float64]
# An effect by its name, and the first round of its search: None, or an `IdloopError`, where it cannot be simulated.
Begin = tuple[str, Callable[[], "Confirmed | None"]]

# Effects that are fitted, unless several promise much the same.
USUAL_REFITS = 8
# An effect that promises, or has gained after one round, this part of the best may become the best.
STILL_IN_IT = 0.5
# Rounds of a full search, and of a search under restricted noise.
MORE_ROUNDS, _ROUGH_ROUNDS = 8, 2


@dataclass(frozen=True)
class Confirmed:
    """A proposal after its refit."""

    proposal: Proposal
    fit: Refit
    gain: float  # log-likelihood above the parent's, never below 0: the parent is one of its models
    statistic: float  # score statistic of the screening
    beside: Proposal | None = None  # the first effect of a pair, of which this is the second

    def refitted(self, fit: Refit, parent: Refit) -> Confirmed:
        """The same with another fit."""
        gain = fit.log_likelihood - parent.log_likelihood
        if self.proposal.effect.slow:
            gain += fit.initial_log_likelihood - parent.initial_log_likelihood
        return replace(self, fit=fit, gain=max(gain, 0.0))


def promising(screened: Sequence[Screened], chance: float, fewest: int = 3) -> list[Screened]:
    """The effects to be fitted, best first: the fewest in any case, the others above chance."""
    ranked = ranked_by_score(screened)
    if not ranked:
        return []
    best = ranked[0].statistic
    # An effect that promises a twentieth of the best is not it; at each of many bodies it promises much the same.
    bars = [0.0] * fewest + [max(0.05 * best, chance)] * (USUAL_REFITS - fewest)
    bars += [max(STILL_IN_IT * best, chance)] * (20 - USUAL_REFITS)
    return [s for s, bar in zip(ranked, bars, strict=False) if s.statistic > bar]


def ranked_by_score(screened: Sequence[Screened]) -> list[Screened]:
    """Those with a score above zero, best first."""
    return sorted((s for s in screened if s.statistic > 0.0), key=lambda s: -s.statistic)


def by_gain(found: Sequence[Confirmed]) -> list[Confirmed]:
    """In order of falling gain."""
    return sorted(found, key=lambda one: -one.gain)


def confirm(
    estimation: EstimationProblem,
    parent: Refit,
    chosen: Sequence[Screened],
    report: Progress = silent,
    matters: Callable[[Confirmed], bool] = lambda first: True,
) -> list[Confirmed]:
    """Refit the parent with each of some effects, in order of falling gain."""
    return search(
        estimation,
        parent,
        [(s.proposal.name, partial(_confirm, estimation, parent, s)) for s in chosen],
        report,
        matters,
    )


def search(
    estimation: EstimationProblem,
    parent: Refit,
    chosen: Sequence[Begin],
    report: Progress,
    matters: Callable[[Confirmed], bool] = lambda first: True,
) -> list[Confirmed]:
    """Search each of some choices for a first round, and to the end those that may still be the best and matter.

    In order of falling gain, without those that cannot be simulated.
    """

    def one(choice: Begin) -> Confirmed | None:
        try:
            return choice[1]()
        except (IdloopError, np.linalg.LinAlgError):
            return None

    def finish(first: Confirmed) -> Confirmed:
        fit = refit_or_none(estimation, first.fit.model, None, first.fit, rounds=MORE_ROUNDS, try_undisturbed=True)
        return first if fit is None or fit.log_likelihood <= first.fit.log_likelihood else first.refitted(fit, parent)

    begun = []
    for i, (choice, confirmed) in enumerate(zip(chosen, in_parallel(one, chosen), strict=True)):
        if confirmed is not None:
            begun.append(confirmed)
        report((i + 1) / len(chosen), choice[0])
    begun = by_gain(begun)
    most = begun[0].gain if begun else 0.0
    # No further round gains 50 units of log-likelihood.
    bar = min(STILL_IN_IT * most, most - 50.0)
    worth = [(first.gain >= bar or _begins_far(first, begun[0])) and matters(first) for first in begun]
    finished = in_parallel(finish, [first for first, front in zip(begun, worth, strict=True) if front])
    return by_gain([*finished, *(first for first, front in zip(begun, worth, strict=True) if not front)])


def _begins_far(first: Confirmed, best: Confirmed) -> bool:
    """Whether an effect that looks like the best one replaces a simpler one, and begins far from its optimum."""
    own, other = first.proposal.effect, best.proposal.effect
    return first.proposal.replaces is not None and (own.name in other.looks_like or other.name in own.looks_like)


def first_round(
    estimation: EstimationProblem, model: Model, thetas: list[Array], beside: Refit, **options: Any
) -> Refit | None:
    """One round of search from several starts; None where the model cannot be simulated."""
    scale = np.max(np.abs(np.array(thetas)), axis=0)
    try:
        return refit(estimation, model, thetas, beside, scale, rounds=1, **options)
    except (IdloopError, np.linalg.LinAlgError):
        return None


def _confirm(estimation: EstimationProblem, parent: Refit, screened: Screened) -> Confirmed | None:
    """The first round of an effect's search, for each choice of integer parameters such as harmonics."""
    proposal = screened.proposal
    # Without a strength a trace does not predict how far the search has to go: more traces are tried.
    count = 2 if proposal.effect.strength else 12
    groups: dict[tuple[float, ...], list[tuple[Trial, Array | None]]] = {}
    for place, trace in enumerate(sorted(screened.traces, key=lambda t: -t.statistic)[:count]):
        # Without a strength to scale, the best trace is searched separately.
        alone = float(place == 0 and not proposal.effect.strength)
        key = (*(trace.trials[0].get(name, 0.0) for name in proposal.whole_numbers), alone)
        groups.setdefault(key, []).extend((values, trace.shift) for values in starts(proposal, trace, place == 0))
    best: Refit | None = None
    searches = [
        (proposal.model(group[0][0]), [at for one, shift in group for at in points(parent, proposal.model(one), shift)])
        for group in groups.values()
    ]
    if proposal.effect.splits:
        trials = [trial for trace in screened.traces for trial in trace.trials]
        near = proposal.model(trials[0]), [_of_the_near_part(parent, proposal, one) for one in trials]
        searches = [near, *searches]
    for model, thetas in searches:
        found = first_round(estimation, model, thetas, parent)
        if found is not None and (best is None or found.log_likelihood > best.log_likelihood):
            best = found
        # Another shape is tried only while none has explained anything.
        explained = 0.0 if best is None else best.log_likelihood - parent.log_likelihood
        if explained > 0.25 * screened.statistic > 0.0 and not proposal.effect.splits:
            break
    if best is None:
        return None
    return Confirmed(proposal, best, 0.0, screened.statistic).refitted(best, parent)


@np.errstate(all="ignore")
def refit_under_restricted_noise(
    estimation: EstimationProblem,
    parent: Refit,
    screened: Sequence[Screened],
    report: Progress = silent,
) -> list[Confirmed]:
    """Refit the parent with the effects that explain most under restricted noise: white errors, a weak disturbance.

    A free noise model absorbs an effect, and the search for its optimum is then long. It is free again afterwards.
    """
    plain = [0] * len(parent.problem.orders)
    # The intensity of a disturbance [decades] that cannot absorb a missing effect.
    limits = -4.0, WALK
    try:
        bare = refit(estimation, parent.model, orders=plain, rounds=_ROUGH_ROUNDS, limits=limits)
    except (IdloopError, np.linalg.LinAlgError):
        return []

    def rough(one: Screened) -> Refit | None:
        models = [one.proposal.model(trace.trials[0]) for trace in one.traces]
        thetas = [points(bare, model, None)[0] for model in models]
        return first_round(estimation, models[0], thetas, bare, orders=plain, limits=limits) if models else None

    def begin(one: Screened, near: Refit) -> Confirmed:
        fit = refit(estimation, near.model, None, near, rounds=_ROUGH_ROUNDS, orders=parent.problem.orders)
        return Confirmed(one.proposal, fit, 0.0, one.statistic).refitted(fit, parent)

    found: list[tuple[Screened, Refit]] = []
    for i, (one, fit) in enumerate(zip(screened, in_parallel(rough, screened), strict=True)):
        if fit is not None and fit.log_likelihood > bare.log_likelihood:
            found.append((one, fit))
        report(0.5 * (i + 1) / len(screened), one.proposal.name)
    found.sort(key=lambda pair: -pair[1].log_likelihood)
    # A noise model absorbs fewer than six effects at once.
    chosen = [(one.proposal.name, partial(begin, one, near)) for one, near in found[:6]]
    return search(estimation, parent, chosen, lambda share, text: report(0.5 + 0.5 * share, text))


def points(parent: Refit, start: Model, shift: Array | None) -> list[Array]:
    """Free parameters to start a search from: an effect's beside the parent's, before and after their expected move.

    `start` is the parent's model with an effect at its trial values, `shift` the expected move of shape (k,).
    """
    known = [dict(zip(parent.model.free, parent.point, strict=False))]
    if shift is not None:
        known.append({name: known[0][name] + d for name, d in zip(parent.model.free, shift, strict=True)})
    return [np.array([values.get(name, start.values[name]) for name in start.free]) for values in known]


def _of_the_near_part(parent: Refit, proposal: Proposal, trial: Trial) -> Array:
    """Free parameters to start from where the fitted inertia is that of the near part of the split body alone.

    Fast motion shows the near part, slow motion both. Where the inertia is known, all forces are smaller instead.
    """
    near, start = 1.0 - trial["split"], proposal.model(trial)
    inertia = f"{proposal.at}.inertia"
    fitted = dict(zip(parent.model.free, parent.point, strict=False))

    def factor(one: Parameter) -> float:
        own, is_force = one.name not in fitted, one.unit.startswith(start.units.force)
        if inertia in fitted:
            return 1.0 / near if one.name == inertia or (own and is_force) else 1.0
        return near if is_force and not own else 1.0

    return np.array([fitted.get(one.name, one.value) * factor(one) for one in start.parameters if one.free])


def starts(proposal: Proposal, trace: Trace, fan: bool = False) -> list[Trial]:
    """Values to start a search from, by the result of the screening.

    With a fan also at strengths around the trial's: an effect with contacts, such as backlash, has many local optima.
    """
    found: list[Trial] = []
    strength = proposal.effect.strength
    # An effect that replaces another one keeps its strength.
    scalable = strength and proposal.replaces is None
    for trial, size in zip(trace.trials, trace.size, strict=True):
        found.append(trial)
        share = float(np.clip(abs(size), 0.02, 50.0))
        if scalable and share != 1.0:
            sign = 1.0 if proposal.one_sided else float(np.sign(size))
            found.append(proposal.inside(proposal.weaker(trial, sign * share)))
    if fan and scalable:
        found += [proposal.inside(proposal.weaker(trace.trials[0], share)) for share in STRENGTH_FACTORS]
    if "phase" in trace.trials[0] and strength:
        base = proposal.weaker(trace.trials[0], float(np.clip(np.linalg.norm(trace.size), 0.02, 1e4)))
        found = [{**base, "phase": phase} for phase in (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)]
        if len(trace.size) > 1:
            found.append({**base, "phase": float(np.arctan2(trace.size[1], trace.size[0]))})
    return found
