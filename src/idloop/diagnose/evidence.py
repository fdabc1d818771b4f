"""Which of the refitted effects is the missing one, how sure that is, and what the data cannot tell from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.calibrate import Null
from idloop.diagnose.confirm import Confirmed, points
from idloop.diagnose.refit import Refit, refit_or_none, transfer
from idloop.diagnose.setting import Setting
from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT

Array = NDArray[np.float64]

# A rival is excluded when its log-likelihood is lower by more than this and by more than twice
# the standard deviation of the difference (Vuong, Econometrica 57, 1989).
LEAST_DIFFERENCE, DEVIATIONS = 4.6, 2.0
# Standard deviations that the gain of an effect must stand above zero where model error, not noise,
# is what is left.
STEADY = 2.33
# Ratio within which a strength that is found on other records is the same.
_ALIKE = 2.0
# Part of a significant statistic that the first round of a search must show.
FIRST_ROUND = 0.5
# Differences of the log-likelihood within which the simpler effect goes first.
_EQUAL = 0.5
_BLOCKS = 50
# Of equals, what sits nearer to the command goes first.
_SITES = (INPUT, BODY, COUPLING, OUTPUT)


def statistic(confirmed: Confirmed) -> float:
    """Twice the log-likelihood ratio, less for a variance that is uneven along the trace.

    A ratio may be the noise model's doing, which the refit has a choice of and the score test, whose
    chance is known, has not: the smaller of the two counts. A slow linear force alone is judged by the
    ratio, which is chi-squared for it; so is what takes a plainer effect's place, which has absorbed
    as much of it as it could, so that its own trial values lie far from where it is best. Where the
    noise model of the parent has swallowed the very errors that the score test looks at, a ratio
    counts by what it has beyond an allowance.
    """
    ratio = 2.0 * confirmed.gain / confirmed.uneven
    if confirmed.proposal.effect.slow or confirmed.proposal.replaces is not None:
        return ratio
    return max(min(ratio, max(confirmed.statistic, 0.0)), 2.0 * confirmed.gain - confirmed.allowance)


def may_decide(first: Confirmed, bar: float) -> bool:
    """Whether an effect may still reach a statistic when its search has only had its first round.

    What takes a plainer effect's place begins far from where it is best, with the disturbance that was strong for
    want of it: after one round it may still be worse than what it replaces, and the score test tells more.

    Parameters
    ----------
    first : Confirmed
    bar : float
        Statistic from which on an effect is significant.

    Returns
    -------
    bool
    """
    if first.proposal.replaces is not None:
        reached = max(2.0 * first.gain, first.statistic)
    else:
        reached = 2.0 * first.gain if first.proposal.effect.slow else first.statistic
    return reached > FIRST_ROUND * bar


def consistent(parent: Refit, confirmed: Confirmed, kind: str) -> bool:
    """Whether a gain stands above what it varies by from one stretch of the data to the next.

    The prediction criterion models its noise, and the calibrated test is enough. A force balance or
    a free run is limited by what the model still lacks, which no white noise stands for: there a
    gain must also be steady.
    """
    if kind == "prediction":
        return True
    return confirmed.gain > STEADY * difference_deviation(confirmed.fit, parent)


def holds(held_out: Setting, parent: Refit, confirmed: Confirmed) -> bool:
    """Whether an effect does no harm on records that the fits did not see.

    While other effects are missing, parameters stand in for them, at each amplitude in another way: a model with the
    right effect may then do worse elsewhere than one without. What harms by its values may still hold by its structure:
    fitted to those records by themselves, it must explain something there, with about the strength that was found.

    Parameters
    ----------
    held_out : Setting
        Validation records.
    parent : Refit
    confirmed : Confirmed

    Returns
    -------
    bool
        False when the log-likelihood there falls by more than chance and the effect does not show there by itself.
    """
    before, after = (transfer(held_out, fit, own_disturbance=True) for fit in (parent, confirmed.fit))
    if after is None:
        return False
    if before is None or not _beyond_chance(before.log_likelihood - after.log_likelihood, before, after):
        return True
    without = refit_or_none(held_out, before.model, None, before)
    if without is None:
        return False
    starts = [after.model.theta, *points(without, after.model, None)]
    found = refit_or_none(held_out, after.model, starts, without)
    if found is None or not distinguishable(found, without):
        return False
    strength = f"{confirmed.proposal.name}.{confirmed.proposal.effect.strength}"
    there, here = (fit.model.values.get(strength, 1.0) for fit in (found, confirmed.fit))
    return there * here > 0.0 and max(there / here, here / there) < _ALIKE


def rank(parent: Refit, confirmed: Sequence[Confirmed], null: Null, level: float) -> list[Confirmed]:
    """Order by gain, less what each effect gains by chance.

    Parameters
    ----------
    parent : Refit
    confirmed : sequence of Confirmed
    null : Null
    level : float
        Family-wise error rate.

    Returns
    -------
    list of Confirmed
        Best first.
    """

    def merit(c: Confirmed) -> float:
        # What the first instants gain counts for all alike, or a force that is judged by them would pass for better
        # than others. What they lose does not: bodies that are new with an effect start somewhere.
        start = max(c.fit.at_start - parent.at_start, 0.0)
        return c.fit.log_likelihood + start - 0.5 * null.own_threshold(c.proposal.name, level)

    ranked = sorted(confirmed, key=lambda c: -merit(c))
    if not ranked:
        return []
    best = merit(ranked[0])
    equal = [c for c in ranked if merit(c) > best - _EQUAL]
    equal.sort(key=lambda c: (c.fit.parameters, _SITES.index(c.proposal.effect.site)))
    return equal + [c for c in ranked if c not in equal]


def tied(best: Confirmed, others: Sequence[Confirmed]) -> list[Confirmed]:
    """Rivals that this data cannot tell from the best effect.

    Richer effects of which the best one is a part, or the edge, are no rivals: they had to be
    significantly better to be chosen.

    Parameters
    ----------
    best : Confirmed
    others : sequence of Confirmed

    Returns
    -------
    list of Confirmed
        Without the best.
    """
    return [c for c in others if not contains(c, best) and not distinguishable(best.fit, c.fit)]


def contains(rich: Confirmed, plain: Confirmed) -> bool:
    """Whether the one effect is the other and more, or ends as it at the edge of its values."""
    effect, name = rich.proposal.effect, plain.proposal.effect.name
    return (name in effect.contains and rich.proposal.at == plain.proposal.at) or name in effect.degenerates_to


def distinguishable(better: Refit, worse: Refit) -> bool:
    """Whether the data prefers one model to the other beyond doubt, less what its further choices gain by chance."""
    difference = better.log_likelihood - worse.log_likelihood - (better.choices - worse.choices)
    return _beyond_chance(difference, better, worse)


def _beyond_chance(difference: float, one: Refit, other: Refit) -> bool:
    """Whether a difference of two log-likelihoods is more than stretches of the data make of it by chance."""
    return difference > LEAST_DIFFERENCE and difference > DEVIATIONS * difference_deviation(one, other)


def difference_deviation(one: Refit, other: Refit) -> float:
    """Standard deviation of the difference of two log-likelihoods, from stretches of the data."""
    total = 0.0
    ones, others = one.contributions(), other.contributions()
    for a, b in zip(ones, others, strict=True):
        if len(a) != len(b):
            return 0.0
        parts = [float(np.sum(part)) for part in np.array_split(a - b, min(_BLOCKS, max(len(a) // 10, 2)))]
        total += len(parts) * float(np.var(parts, ddof=1))
    return float(np.sqrt(total))


def explained(parent: Refit, fit: Refit) -> float:
    """Share of the one-step errors' excess power that an effect takes away, 0 to 1.

    The excess is what the disturbance and the whitening had to account for: measured by the
    generalised variance of the innovations per output.
    """
    samples = sum(len(c) for c in parent.contributions())
    outputs = sum(len(w) for w in parent.problem.weights)
    gain = max(fit.log_likelihood - parent.log_likelihood, 0.0)
    return float(1.0 - np.exp(-2.0 * gain / max(samples * outputs / max(len(parent.problem.weights), 1), 1)))
