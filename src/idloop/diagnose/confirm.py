"""Full refits of the most promising effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.proposals import Proposal
from idloop.diagnose.screen import Screened, Trace
from idloop.errors import IdloopError
from idloop.estimate.innovations import WALK
from idloop.estimate.likelihood.parallel import in_parallel
from idloop.estimate.likelihood.refit import FAN, Refit, refit, refit_or_none
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.model import Model
from idloop.physics.trial import Trial

Array = NDArray[np.float64]
_Choice = TypeVar("_Choice")

# Effects that are refitted: the best few, and no more that promise less than this part of the best.
USUAL_REFITS, LEAST_SHARE, FEWEST_REFITS = 8, 0.05, 3
# More of them where one effect at many bodies promises much the same; which body it is, only refits tell.
MOST_REFITS, MUCH_THE_SAME = 20, 0.5
# After a first round of search, effects that gained less than this part of the best and are worse
# by this much log-likelihood are not searched further.
WORTH_FINISHING, CLEARLY_WORSE, MORE_ROUNDS = 0.5, 50.0, 8
# Trial values from which a search starts: of effects with a strength to scale, and without.
_FEW, _MANY = 2, 12
# Rounds of a search that only leads to the neighbourhood.
_ROUGH_ROUNDS = 2
# Intensity of a disturbance that cannot make up for a missing effect [decades].
WEAK = -4.0
# Effects that are looked at behind a noise model that has swallowed one.
_BEHIND_NOISE = 6
# Phases from which a search for a wave starts.
_PHASES = (0.0, 1.5707963267948966, 3.141592653589793, -1.5707963267948966)


@dataclass(frozen=True)
class Confirmed:
    """A proposal after its refit.

    Attributes
    ----------
    proposal : Proposal
    fit : Refit
    gain : float
        Log-likelihood above the parent's, never below 0: the parent is one of its models.
    statistic : float
        Score statistic of the screening.
    """

    proposal: Proposal
    fit: Refit
    gain: float
    statistic: float

    def refitted(self, fit: Refit, parent: Refit) -> Confirmed:
        """The same with another fit."""
        gain = fit.log_likelihood - parent.log_likelihood
        if self.proposal.effect.slow:
            gain += fit.at_start - parent.at_start
        return replace(self, fit=fit, gain=max(gain, 0.0))


def promising(screened: Sequence[Screened], chance: float, fewest: int = FEWEST_REFITS) -> list[Screened]:
    """The screened effects that are worth a refit, best first.

    Parameters
    ----------
    screened : sequence of Screened
    chance : float
        Statistic that the best of the catalogue often reaches by chance; below it the best few do.
    fewest : int
        How many those few are.
    """
    ranked = sorted((s for s in screened if s.statistic > 0.0), key=lambda s: -s.statistic)
    if not ranked:
        return []
    best = ranked[0].statistic
    bars = [0.0] * fewest + [max(LEAST_SHARE * best, chance)] * (USUAL_REFITS - fewest)
    bars += [max(MUCH_THE_SAME * best, chance)] * (MOST_REFITS - len(bars))
    return [s for s, bar in zip(ranked, bars, strict=False) if s.statistic > bar]


def confirm(
    setting: Setting,
    parent: Refit,
    chosen: Sequence[Screened],
    report: Callable[[float, str], None] | None = None,
    matters: Callable[[Confirmed], bool] | None = None,
) -> list[Confirmed]:
    """Refit the parent with each of some effects.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    chosen : sequence of Screened
    report : callable, optional
        Called with the share done and a text.
    matters : callable, optional
        As in `search`.

    Returns
    -------
    list of Confirmed
        In order of falling gain; effects that cannot be simulated are left out.
    """
    found = search(
        setting,
        parent,
        chosen,
        lambda screened: _confirm(setting, parent, screened),
        lambda share, screened: report(share, screened.proposal.name) if report is not None else None,
        matters,
    )
    return [confirmed for _, confirmed in found]


def search(
    setting: Setting,
    parent: Refit,
    chosen: Sequence[_Choice],
    begin: Callable[[_Choice], Confirmed | None],
    report: Callable[[float, _Choice], None],
    matters: Callable[[Confirmed], bool] | None = None,
) -> list[tuple[_Choice, Confirmed]]:
    """Refit each of some choices for a first round, and to the end those that may still be the best.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    chosen : sequence
        What there is to choose from.
    begin : callable
        The first round of one choice; None, or an `IdloopError`, where it cannot be simulated.
    report : callable
        Called with the share done and the choice.
    matters : callable, optional
        Whether a choice may still decide something after its first round; all may when left out.

    Returns
    -------
    list of tuple
        The choices with their refits, in order of falling gain, without those that cannot be simulated.
    """

    def one(choice: _Choice) -> Confirmed | None:
        try:
            return begin(choice)
        except (IdloopError, np.linalg.LinAlgError):
            return None

    def finish(begun: tuple[_Choice, Confirmed]) -> tuple[_Choice, Confirmed]:
        choice, first = begun
        fit = refit_or_none(setting, first.fit.model, None, first.fit, rounds=MORE_ROUNDS, calm=True)
        if fit is None or fit.log_likelihood <= first.fit.log_likelihood:
            return begun
        return choice, first.refitted(fit, parent)

    found: list[tuple[_Choice, Confirmed]] = []
    for i, (choice, confirmed) in enumerate(zip(chosen, in_parallel(one, chosen), strict=True)):
        if confirmed is not None:
            found.append((choice, confirmed))
        report((i + 1) / len(chosen), choice)
    if not found:
        return found
    found.sort(key=_falling_gain)
    most = found[0][1].gain
    bar = min(WORTH_FINISHING * most, most - CLEARLY_WORSE)
    front: list[tuple[_Choice, Confirmed]] = []
    rest: list[tuple[_Choice, Confirmed]] = []
    for begun in found:
        worth = begun[1].gain >= bar and (matters is None or matters(begun[1]))
        (front if worth else rest).append(begun)
    return sorted([*in_parallel(finish, front), *rest], key=_falling_gain)


def _falling_gain(found: tuple[_Choice, Confirmed]) -> float:
    return -found[1].gain


def _confirm(setting: Setting, parent: Refit, screened: Screened) -> Confirmed | None:
    proposal = screened.proposal
    # Where nothing says how strong an effect is, no trace tells how far the search has to go.
    count = _FEW if proposal.effect.strength else _MANY
    traces = sorted(screened.traces, key=lambda t: -t.statistic)[:count]
    best: Refit | None = None
    for model, starts in _by_structure(proposal, traces):
        thetas = [theta for values, shift in starts for theta in points(parent, proposal.model(values), shift)]
        scale = np.max(np.abs(np.array(thetas)), axis=0)
        found = refit_or_none(setting, model, thetas, parent, scale, rounds=1)
        if found is not None and (best is None or found.log_likelihood > best.log_likelihood):
            best = found
        # Another shape is only worth its time while none has explained anything.
        if best is not None and best.log_likelihood - parent.log_likelihood > 0.25 * screened.statistic > 0.0:
            break
    if best is None:
        return None
    return Confirmed(proposal, best, 0.0, screened.statistic).refitted(best, parent)


@np.errstate(all="ignore")
def confirm_behind_noise(
    setting: Setting,
    parent: Refit,
    screened: Sequence[Screened],
    report: Callable[[float, str], None] | None = None,
) -> list[Confirmed]:
    """Refit the parent with the effects that explain most when the noise may explain next to nothing.

    A free whitening and a strong disturbance make up for anything, and the way from there to an effect's
    optimum is long and winding. With white errors and a weak disturbance it is short.

    Parameters
    ----------
    setting : Setting
    parent : Refit
        Of which the noise model has swallowed an effect.
    screened : sequence of Screened
        All effects.
    report : callable, optional
        Called with the share done and a text.

    Returns
    -------
    list of Confirmed
        The best few, with the noise model free again, in order of falling gain.
    """
    plain = [0] * len(parent.problem.orders)
    limits = WEAK, WALK
    try:
        bare = refit(setting, parent.model, orders=plain, rounds=_ROUGH_ROUNDS, limits=limits)
    except (IdloopError, np.linalg.LinAlgError):
        return []

    def rough(one: Screened) -> Refit | None:
        models = [one.proposal.model(trace.trials[0]) for trace in one.traces]
        if not models:
            return None
        thetas = [points(bare, model, None)[0] for model in models]
        scale = np.max(np.abs(np.array(thetas)), axis=0)
        try:
            return refit(setting, models[0], thetas, bare, scale, rounds=1, orders=plain, limits=limits)
        except (IdloopError, np.linalg.LinAlgError):
            return None

    found: list[tuple[Screened, Refit]] = []
    for i, (one, fit) in enumerate(zip(screened, in_parallel(rough, screened), strict=True)):
        if fit is not None and fit.log_likelihood > bare.log_likelihood:
            found.append((one, fit))
        if report is not None:
            report(0.5 * (i + 1) / len(screened), one.proposal.name)
    found.sort(key=lambda pair: -pair[1].log_likelihood)

    def begin(pair: tuple[Screened, Refit]) -> Confirmed:
        one, near = pair
        fit = refit(setting, near.model, None, near, rounds=_ROUGH_ROUNDS, orders=parent.problem.orders)
        return Confirmed(one.proposal, fit, 0.0, one.statistic).refitted(fit, parent)

    def told(share: float, pair: tuple[Screened, Refit]) -> None:
        if report is not None:
            report(0.5 + 0.5 * share, pair[0].proposal.name)

    return [confirmed for _, confirmed in search(setting, parent, found[:_BEHIND_NOISE], begin, told)]


def points(parent: Refit, start: Model, shift: Array | None) -> list[Array]:
    """Free parameters to start a search from: an effect's beside the parent's as they are, and as they would move.

    Parameters
    ----------
    parent : Refit
    start : Model
        The parent's with an effect at its trial values.
    shift : array, shape (k,), or None
        Expected move of the parent's parameters.

    Returns
    -------
    list of array
    """
    known = [dict(zip(parent.model.free, parent.point, strict=False))]
    if shift is not None:
        known.append({name: known[0][name] + d for name, d in zip(parent.model.free, shift, strict=True)})
    return [np.array([values.get(name, start.values[name]) for name in start.free]) for values in known]


def _by_structure(proposal: Proposal, traces: list[Trace]) -> list[tuple[Model, list[tuple[Trial, Array | None]]]]:
    """Start values by what a search cannot move: whole numbers such as harmonics.

    Without a strength to scale, the best trace goes by itself: of the others one may look better before
    the search than it ever does after it.
    """
    found: dict[tuple[tuple[str, float], ...], list[tuple[Trial, Array | None]]] = {}
    integers = [spec.name for spec in proposal.effect.parameters if spec.integer]
    for place, trace in enumerate(traces):
        key = tuple((name, trace.trials[0].get(name, 0.0)) for name in integers)
        if not proposal.effect.strength:
            key = (*key, ("first", float(place == 0)))
        found.setdefault(key, []).extend((values, trace.shift) for values in starts(proposal, trace, place == 0))
    return [(proposal.model(values[0][0]), values) for values in found.values()]


def starts(proposal: Proposal, trace: Trace, fan: bool = False) -> list[Trial]:
    """Values to start a search from, by what the screening found.

    Parameters
    ----------
    proposal : Proposal
    trace : Trace
    fan : bool
        Also at strengths around the trial's: what has walls, such as a play, has many local optima.
    """
    found: list[Trial] = []
    strength = proposal.effect.strength
    for trial, size in zip(trace.trials, trace.size, strict=True):
        found.append(trial)
        share = float(np.clip(abs(size), 0.02, 50.0))
        # What takes another effect's place keeps that one's strength.
        if strength and share != 1.0 and proposal.replaces is None:
            sign = 1.0 if proposal.one_sided else float(np.sign(size))
            found.append(proposal.inside(proposal.weaker(trial, sign * share)))
    if fan and strength and proposal.replaces is None:
        found += [proposal.inside(proposal.weaker(trace.trials[0], share)) for share in FAN]
    if "phase" in trace.trials[0] and strength:
        reach = float(np.clip(np.linalg.norm(trace.size), 0.02, 1e4))
        base = proposal.weaker(trace.trials[0], reach)
        found = [{**base, "phase": phase} for phase in _PHASES]
        if len(trace.size) > 1:
            found.append({**base, "phase": float(np.arctan2(trace.size[1], trace.size[0]))})
    return found
