"""Significance of the difference of two log-likelihoods (Vuong, Econometrica 57, 1989)."""

from __future__ import annotations

import numpy as np

from idloop.estimation.likelihood.refit import Refit

# A difference is significant above this value and above so many of its standard deviations.
LEAST_DIFFERENCE, DEVIATIONS = 4.6, 2.0
_SEGMENTS = 50


def distinguishable(better: Refit, worse: Refit) -> bool:
    """Whether one model is significantly likelier than another, less one unit for each further parameter."""
    difference = better.log_likelihood - worse.log_likelihood - (better.choices - worse.choices)
    return beyond_chance(difference, better, worse)


def beyond_chance(difference: float, one: Refit, other: Refit) -> bool:
    """Whether a difference of two log-likelihoods is significant."""
    return difference > LEAST_DIFFERENCE and difference > DEVIATIONS * difference_deviation(one, other)


def difference_deviation(one: Refit, other: Refit) -> float:
    """Standard deviation of the difference of two log-likelihoods, from segments of the data."""
    total = 0.0
    for a, b in zip(one.contributions(), other.contributions(), strict=True):
        if len(a) != len(b):
            return 0.0
        parts = [float(np.sum(part)) for part in np.array_split(a - b, min(_SEGMENTS, max(len(a) // 10, 2)))]
        total += len(parts) * float(np.var(parts, ddof=1))
    return float(np.sqrt(total))
