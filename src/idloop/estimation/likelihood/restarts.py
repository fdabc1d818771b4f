"""Restarts of a search near its end point.

With backlash, or another effect with memory, the likelihood has many local optima: contact occurs a sample sooner or
later. Models are compared fairly only when each is the best of as many searches.
"""

from __future__ import annotations

import numpy as np

from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.physics.model import Model

# Number of searches, and the standard deviation of their starting values [standard errors].
_SEARCHES, _DEVIATION = 8, 1.0
# Most rounds of restarts, and the gain of log-likelihood that is worth another one.
_ROUNDS, _WORTH = 3, 4.0


def has_contacts(model: Model) -> bool:
    """Whether the model has contacts that open and close, at each of which the likelihood jumps."""
    return any(active.effect.lost_motion for active in model.effects)


def search_repeatedly(estimation: EstimationProblem, fit: Refit) -> Refit:
    """Best of searches without the neighbour's noise model and of restarts near the best, as long as it improves.

    A fit of backlash begins with the disturbance that replaced it in the model without it, and may stay in a local
    optimum with half of that disturbance.
    """
    for round_ in range(_ROUNDS):
        before = fit.log_likelihood
        anew = refit_or_none(estimation, fit.model)
        if anew is not None and anew.log_likelihood > before:
            fit = anew
        fit = restart_nearby(estimation, fit, round_)
        if fit.log_likelihood < before + _WORTH:
            break
    return fit


def restart_nearby(estimation: EstimationProblem, fit: Refit, seed: int = 0) -> Refit:
    """Best of a fit and of searches from random points around it."""
    rng = np.random.default_rng(seed)
    free = [p for p in fit.with_stderr().parameters if p.name in fit.model.free]

    def moved() -> Model:
        values = {}
        for p in free:
            bounds, error = fit.model.parameter(p.name), p.stderr or 0.0
            step = _DEVIATION * (error if np.isfinite(error) else 0.0) * rng.normal()
            values[p.name] = float(np.clip(p.value + step, bounds.min, bounds.max))
        return fit.model.with_values(values)

    starts = [moved() for _ in range(_SEARCHES)]
    found = in_parallel(lambda model: refit_or_none(estimation, model, None, fit), starts)
    return max([fit, *(one for one in found if one is not None)], key=lambda one: one.log_likelihood)
