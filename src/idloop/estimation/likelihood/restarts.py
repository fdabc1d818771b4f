"""The best of several searches from nearby.

Beside a play, or another effect that remembers, the likelihood is rough: contact comes a sample sooner or later, and a
search ends in one of many hollows. A candidate is the best of many searches; its parent must have had as many before a
gain of a few units counts.
"""

from __future__ import annotations

import numpy as np

from idloop.estimation.likelihood.estimation_problem import Setting
from idloop.estimation.likelihood.intervals import with_stderr
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit, refit_or_none
from idloop.physics.model import Model

# Searches, and how far from the best point known they begin [standard errors].
COUNT, SPREAD = 8, 1.0
# Most rounds of a search that begins anew, and gain of log-likelihood below which another is not worth its while.
_ROUNDS, _WORTH = 3, 4.0


def has_contacts(model: Model) -> bool:
    """Whether bodies of a model, or a body and its sensor, meet and part: the likelihood jumps with each meeting."""
    return any(active.effect.lost_motion for active in model.effects)


def searched_anew(setting: Setting, fit: Refit) -> Refit:
    """Search as if no neighbour were known, and about what that finds, as long as it helps.

    A play is first fitted beside the disturbance that stood for it in the model without it, and what the two
    say together may be a hollow in which the search stays: half of the disturbance is left, and friction suits it.

    Parameters
    ----------
    setting : Setting
    fit : Refit
        Of a model with contacts.

    Returns
    -------
    Refit
        The best of all; the fit itself where no other is better.
    """
    for round_ in range(_ROUNDS):
        before = fit.log_likelihood
        anew = refit_or_none(setting, fit.model)
        if anew is not None and anew.log_likelihood > before:
            fit = anew
        fit = restarted(setting, fit, round_)
        if fit.log_likelihood < before + _WORTH:
            break
    return fit


def restarted(setting: Setting, fit: Refit, seed: int = 0) -> Refit:
    """Search again from points about a fit.

    Parameters
    ----------
    setting : Setting
    fit : Refit
    seed : int
        Of the points.

    Returns
    -------
    Refit
        The best of all; the fit itself where no other is better.
    """
    fitted = with_stderr(fit, setting.records)
    values = {p.name: (p.value, p.stderr or 0.0) for p in fitted.parameters if p.name in fit.model.free}
    sizes = {name: error if np.isfinite(error) else 0.0 for name, (_, error) in values.items()}
    rng = np.random.default_rng(seed)

    def moved() -> Model:
        return fit.model.with_values(
            {
                name: float(np.clip(value + SPREAD * sizes[name] * rng.normal(), *_bounds(fit.model, name)))
                for name, (value, _) in values.items()
            }
        )

    starts = [moved() for _ in range(COUNT)]
    found = in_parallel(lambda model: refit_or_none(setting, model, None, fit), starts)
    return max([fit, *(one for one in found if one is not None)], key=lambda one: one.log_likelihood)


def _bounds(model: Model, name: str) -> tuple[float, float]:
    parameter = model.parameter(name)
    return parameter.min, parameter.max
