"""Whether the difference of two log-likelihoods is more than the stretches of a record make of it by chance."""

from __future__ import annotations

import numpy as np

from idloop.estimation.likelihood.refit import Refit

# A model is told from a better one when its log-likelihood is lower by more than this and by more than twice the
# standard deviation of the difference (Vuong, Econometrica 57, 1989).
LEAST_DIFFERENCE, DEVIATIONS = 4.6, 2.0
_BLOCKS = 50


def distinguishable(better: Refit, worse: Refit) -> bool:
    """Whether the data prefers one model to the other beyond doubt, less what its further choices gain by chance."""
    difference = better.log_likelihood - worse.log_likelihood - (better.choices - worse.choices)
    return beyond_chance(difference, better, worse)


def beyond_chance(difference: float, one: Refit, other: Refit) -> bool:
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
