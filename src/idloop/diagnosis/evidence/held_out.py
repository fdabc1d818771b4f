"""Whether an effect holds on records that the fits did not see."""

from __future__ import annotations

from idloop.diagnosis.screening.proposals import Proposal
from idloop.diagnosis.search.confirm import points
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.likelihood_difference import beyond_chance, distinguishable
from idloop.estimation.likelihood.refit import Refit, refit_or_none, transfer


def holds(held_out: EstimationProblem, parent: Refit, proposal: Proposal, fit: Refit) -> bool:
    """Whether an effect does no harm on records that the fits, without it and with it, did not see.

    No when the log-likelihood there falls by more than chance and the effect does not show there by itself.
    """
    # While other effects are missing, parameters stand in for them, at each amplitude in another way: a model with the
    # right effect may then do worse elsewhere than one without. What harms by its values may still hold by its
    # structure: fitted to those records by themselves, it must explain something there, with about the strength that
    # was found.
    before, after = (transfer(held_out, one, own_disturbance=True) for one in (parent, fit))
    if after is None:
        return False
    if before is None or not beyond_chance(before.log_likelihood - after.log_likelihood, before, after):
        return True
    without = refit_or_none(held_out, before.model, None, before)
    if without is None:
        return False
    starts = [after.model.theta, *points(without, after.model, None)]
    found = refit_or_none(held_out, after.model, starts, without)
    if found is None or not distinguishable(found, without):
        return False
    strength = f"{proposal.name}.{proposal.effect.strength}"
    there, here = (one.model.values.get(strength, 1.0) for one in (found, fit))
    return there * here > 0.0 and max(there / here, here / there) < 2.0
