"""Searches for what the data cannot tell from the best effect, whatever a score said of it.

Of effects that leave one trace only some are screened with power: a disturbance, a gain or the data's own poverty may
have taken the trace of another for itself. Once one of them has shown, all are fitted, from the best one's optimum as
well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnose.confirm import Confirmed, confirm, points
from idloop.diagnose.footing import beside_the_noise_of
from idloop.diagnose.likelihood_difference import distinguishable
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.refit import FAN, Refit, refit_or_none
from idloop.diagnose.screen import Screened
from idloop.diagnose.setting import Setting
from idloop.diagnose.step import Weighed

# Correlation of two traces from which on they are taken for one.
ALIKE = 0.95
# Searches for an effect from the best one's optimum.
_SEARCHES = 2


def from_the_best(
    setting: Setting,
    parent: Refit,
    best: Weighed[Refit],
    screened: Sequence[Screened],
    confirmed: Sequence[Confirmed],
) -> list[Confirmed]:
    """Fit effects that leave the trace of the best one from its optimum as well.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    best : Weighed
        One effect.
    screened : sequence of Screened
        All effects.
    confirmed : sequence of Confirmed
        All that were fitted.

    Returns
    -------
    list of Confirmed
    """
    (proposal,) = best.proposals
    names = {s.proposal.name for s in alike(proposal.name, screened)}
    tried = [c for c in confirmed if c.proposal.name in names]
    rest = names - {c.proposal.name for c in tried}
    tried += confirm(setting, parent, [s for s in screened if s.proposal.name in rest])
    first = Confirmed(proposal, best.fit, best.gain, 0.0)
    searched = list(in_parallel(lambda c: _from_the_best(setting, parent, first, c), tried))
    return beside_the_noise_of(first, setting, parent, searched)


def alike(name: str, screened: Sequence[Screened]) -> list[Screened]:
    """Effects that can leave the trace of another one, by one direction or by several together."""
    own = [t.direction for s in screened if s.proposal.name == name for t in s.traces if t.direction is not None]
    return [s for s in screened if s.proposal.name != name and any(t.reaches(d) > ALIKE for t in s.traces for d in own)]


def _from_the_best(setting: Setting, parent: Refit, best: Confirmed, c: Confirmed) -> Confirmed:
    """A candidate that explains less than its trace promises, searched from the best one's optimum as well."""
    if not distinguishable(best.fit, c.fit):
        return c
    (start,) = points(best.fit, c.fit.model, None)
    choices = [start]
    strength = f"{c.proposal.name}.{c.proposal.effect.strength}"
    if strength in c.fit.model.free:
        place = c.fit.model.free.index(strength)
        choices += [np.where(np.arange(len(start)) == place, share * start, start) for share in FAN]
    found = c
    beside = best.fit
    for _ in range(_SEARCHES):
        fit = refit_or_none(setting, c.fit.model, choices, beside)
        if fit is None:
            break
        if fit.log_likelihood > found.fit.log_likelihood:
            found = found.refitted(fit, parent)
        if not distinguishable(best.fit, found.fit) or len(fit.nuisance) != len(best.fit.nuisance):
            break
        # On its way the search may have lost the best one's disturbance, which suits whoever explains the same.
        choices, beside = [fit.model.theta], replace(fit, point=np.append(fit.model.theta, best.fit.nuisance))
    return found
