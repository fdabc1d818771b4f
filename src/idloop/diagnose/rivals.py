"""What this data cannot tell from the best effect, whatever a score said of it.

Of effects that leave one trace only some are tested with power: a disturbance, a gain or the data's own poverty may
have taken the trace of another for itself. Once one of them has shown, all are refitted, from the best one's optimum as
well, and one that explains more beyond doubt takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnose.confirm import Confirmed, confirm, points
from idloop.diagnose.evidence import contains, distinguishable, holds, tied
from idloop.diagnose.footing import beside_the_noise_of
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.reach import at_its_bound
from idloop.diagnose.refit import FAN, Refit, refit_or_none
from idloop.diagnose.screen import Screened
from idloop.diagnose.setting import Setting

# Correlation of two traces from which on they are taken for one.
ALIKE = 0.95
# Searches for an effect from the best one's optimum.
_SEARCHES = 2


def with_rivals(
    setting: Setting,
    parent: Refit,
    best: Confirmed,
    significant: Sequence[Confirmed],
    screened: Sequence[Screened],
    confirmed: Sequence[Confirmed],
    *,
    bar: float,
    held_out: Setting | None = None,
) -> tuple[Confirmed, list[Confirmed]]:
    """Find the rivals of the best effect, and the better one among those that leave its trace.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    best : Confirmed
    significant : sequence of Confirmed
        The other significant effects, best first.
    screened : sequence of Screened
        All effects.
    confirmed : sequence of Confirmed
        All that were refitted.
    bar : float
        Statistic from which on an effect is significant, and so better than one that already explains the same.
    held_out : Setting, optional
        Validation records, on which the better one must do no harm.

    Returns
    -------
    best : Confirmed
        The same, or the one that takes its place.
    rivals : list of Confirmed
        Those that this data cannot tell from it.
    """
    names = {s.proposal.name for s in alike(best, screened)} - {c.proposal.name for c in significant}
    tried = [c for c in confirmed if c.proposal.name in names]
    rest = names - {c.proposal.name for c in tried}
    tried += confirm(setting, parent, [s for s in screened if s.proposal.name in rest])
    first = best
    searched = list(in_parallel(lambda c: _from_the_best(setting, parent, first, c), tried))
    like = beside_the_noise_of(best, setting, parent, searched)
    for c in sorted(like, key=lambda c: -c.fit.log_likelihood):
        lead = c.fit.log_likelihood - best.fit.log_likelihood - (c.fit.choices - best.fit.choices)
        if 2.0 * lead < bar:
            break
        # A richer effect is a later step of the ladder, which it has to earn.
        if (
            not contains(c, best)
            and distinguishable(c.fit, best.fit)
            and not at_its_bound(c.fit.model, c.proposal)
            and (held_out is None or holds(held_out, parent, c))
        ):
            like = [best, *(other for other in like if other is not c)]
            best = c
            break
    return best, [*tied(best, significant), *tied(best, like)]


def alike(best: Confirmed, screened: Sequence[Screened]) -> list[Screened]:
    """Effects that can leave the trace of the best one, by one direction or by several together."""
    own = [
        t.direction
        for s in screened
        if s.proposal.name == best.proposal.name
        for t in s.traces
        if t.direction is not None
    ]
    return [
        s
        for s in screened
        if s.proposal.name != best.proposal.name and any(t.reaches(d) > ALIKE for t in s.traces for d in own)
    ]


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
