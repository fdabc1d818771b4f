"""Models that are compared stand on the same footing: what one search found of the noise, the others may use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.confirm import Confirmed, without_long_memory
from idloop.diagnose.disturbance import LONG_MEMORY
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.refit import Refit, refit, refit_or_none
from idloop.diagnose.restarts import has_contacts, restarted
from idloop.diagnose.setting import Setting
from idloop.estimate.innovations import InnovationCriterion
from idloop.physics.model import Model

# Above the threshold by less than this a gain may be that of a better noise model, or of another search.
DOUBTFUL = 60.0


def same_footing(
    setting: Setting, parent: Refit, confirmed: list[Confirmed], threshold: float
) -> tuple[Refit, list[Confirmed]]:
    """Let the parent profit from a better noise model, or optimum, that a candidate's search has found.

    Near the threshold, or far above what the score test promised, a gain may be the noise model's. Beside
    a play or a filter it may always be that of a better optimum: there are many.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    confirmed : list of Confirmed
    threshold : float
        Statistic from which on an effect is significant.

    Returns
    -------
    tuple
        The parent, better or as it was, and the candidates with what they gain above it.
    """
    near = [
        c
        for c in sorted(confirmed, key=lambda c: -c.gain)
        if 2.0 * c.gain > threshold
        and (2.0 * c.gain < threshold + DOUBTFUL or 2.0 * c.gain > 4.0 * c.statistic or _rough(parent.model))
    ]
    if not near:
        return parent, confirmed
    lifted = False
    if has_contacts(parent.model) and any(2.0 * c.gain < threshold + DOUBTFUL for c in near):
        again = restarted(setting, parent)
        lifted = again is not parent
        confirmed = _above(confirmed, again.log_likelihood - parent.log_likelihood)
        parent = again
    for c in near[:2]:
        again = refit(setting, parent.model, [_without_it(parent, c), parent.point[: parent.parameters]], c.fit)
        if again.log_likelihood > parent.log_likelihood:
            confirmed = _above(confirmed, again.log_likelihood - parent.log_likelihood)
            parent, lifted = again, True
    if lifted:
        lifted_parent = parent
        confirmed = list(
            in_parallel(
                lambda c: _beside(setting, lifted_parent, c) if c.statistic > max(threshold, 2.0 * c.gain) else c,
                confirmed,
            )
        )
    return parent, confirmed


def _without_it(parent: Refit, confirmed: Confirmed) -> NDArray[np.float64]:
    """The parent's free parameters as a candidate has found them, those of an effect that it replaces by their part."""
    found, proposal = confirmed.fit.model.values, confirmed.proposal
    plain, _, _ = (proposal.replaces or "").partition("@")
    inner = proposal.effect.contains.get(plain, {})
    known = {f"{proposal.replaces}.{own}": found[f"{proposal.name}.{other}"] for own, other in inner.items()}
    known |= {name: found[name] for name in parent.model.free if name in found}
    values = zip(parent.model.free, parent.point, strict=False)
    return np.array([known.get(name, value) for name, value in values])


def _above(confirmed: list[Confirmed], lift: float) -> list[Confirmed]:
    """What candidates gain above a parent that is better by `lift`."""
    return [replace(one, gain=max(one.gain - lift, 0.0)) for one in confirmed]


def _rough(model: Model) -> bool:
    """Whether a model has effects that remember, or sides that touch and part: its likelihood has many local optima."""
    return has_contacts(model) or any(active.effect.lags for active in model.effects)


def beside_the_noise_of(
    best: Confirmed, setting: Setting, parent: Refit, confirmed: list[Confirmed]
) -> list[Confirmed]:
    """Refit rivals of a constant force with the shorter memory that it was found beside.

    Parameters
    ----------
    best : Confirmed
        Any effect; the rivals of another than a slow one are returned as they are.
    setting : Setting
    parent : Refit
    confirmed : list of Confirmed

    Returns
    -------
    list of Confirmed
    """
    if not isinstance(parent.criterion, InnovationCriterion):
        return confirmed
    own = best.fit.criterion
    forgets = isinstance(own, InnovationCriterion) and own.memory < LONG_MEMORY <= parent.criterion.memory
    if not best.proposal.effect.slow or not forgets:
        return confirmed
    return list(in_parallel(lambda c: c if c.proposal.effect.slow else _forgetting(setting, parent, c), confirmed))


def _forgetting(setting: Setting, parent: Refit, confirmed: Confirmed) -> Confirmed:
    """A candidate refitted by way of a disturbance with a short memory, if that explains more."""
    again = confirmed.refitted(without_long_memory(setting, parent, confirmed.fit), parent)
    return again if again.gain > confirmed.gain else confirmed


def _beside(setting: Setting, parent: Refit, confirmed: Confirmed) -> Confirmed:
    """A candidate refitted with the noise of a parent that has been lifted."""
    model = confirmed.fit.model
    shared = {name: parent.model.values[name] for name in parent.model.free if name in model.values}
    starts = [model.theta, model.with_values(shared).theta]
    fit = refit_or_none(setting, model, starts, parent)
    again = confirmed if fit is None else confirmed.refitted(fit, parent)
    return again if again.gain > confirmed.gain else confirmed
