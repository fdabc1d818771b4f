"""Rivals for the question whether an effect exists: the model with and without it.

An effect that the data so far cannot show has no fitted size. It takes a typical one: the middle of the sizes that the
effect proposes for motions within the limits, of those that the data so far allow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.design.limits import Limits
from idloop.diagnosis.design.rival_set import log_likelihood_losses
from idloop.diagnosis.design.suggest import Suggestion, suggest
from idloop.diagnosis.identifiability import NOT_REPEATED
from idloop.diagnosis.options import Progress
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.errors import InputError
from idloop.estimation.likelihood.estimation_problem import prepare_estimation

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.physics.trial import Scales
    from idloop.records import Record

# Log-likelihood that a size of the effect may cost on the data so far.
_ALLOWED = 10.0


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def suggest_effect(
    model: Model,
    effect: str,
    records: Sequence[Record],
    limits: Limits | None = None,
    *,
    duration: float | None = None,
    seed: int = 0,
    start: float | None = None,
    adds_to: str | None = None,
    progress: Progress | None = None,
) -> Suggestion:
    """Choose the experiment that would show whether an effect is there.

    Parameters
    ----------
    model : Model
        Fitted to the records, without the effect.
    effect : str
        ``effect@site``.
    records, limits, duration, seed, start, adds_to, progress
        As in `suggest`.

    Raises
    ------
    InputError
        As `suggest`, or the model cannot have this effect.
    """
    rivals = effect_rivals(model, effect, records, limits or Limits())
    return suggest(
        rivals, records, limits, duration=duration, seed=seed, start=start, adds_to=adds_to, progress=progress
    )


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def effect_rivals(model: Model, effect: str, records: Sequence[Record], limits: Limits) -> tuple[Model, Model]:
    """The model without and with an effect, ``effect@site``, of typical size for the limits of the experiment."""
    proposal = find_proposal(model, effect)
    sizes = Sizes(model, prepare_estimation(model, records, "prediction"))
    scales = _allowed_scales(sizes.at(proposal.effect.site, proposal.at), limits.completed(model, records))
    choices = [proposal.model(group[0]) for group in proposal.alternatives(scales) if group]
    if not choices:
        raise InputError(f"{effect}: {NOT_REPEATED}; allow more travel")
    costs = log_likelihood_losses(model, choices, records)
    allowed = [choice for choice, cost in zip(choices, costs, strict=True) if cost < _ALLOWED]
    typical = allowed[len(allowed) // 2] if allowed else choices[int(np.argmin(costs))]
    return proposal.base, typical


def find_proposal(model: Model, effect: str) -> Proposal:
    """The proposal of an effect at its site; an `InputError` where the model has it or cannot have it."""
    found = [proposal for proposal in proposals(model, [effect]) if proposal.name == effect]
    if not found:
        raise InputError(f"{effect}: model {model.name} has this effect, or cannot have it; write effect@site")
    return found[0]


def _allowed_scales(scales: Scales, limits: Limits) -> Scales:
    """Sizes of a motion that uses what the limits allow."""
    changes: dict[str, Any] = {}
    if limits.command is not None:
        grown = limits.command / scales.command_most
        changes |= {"command_most": limits.command, "command": scales.command * grown, "force": scales.force * grown}
    if limits.velocity is not None:
        changes |= {"speed_most": limits.velocity, "speed": max(scales.speed, 0.5 * limits.velocity)}
    if limits.position is not None:
        low, high = limits.position
        turns = (high - low) / (2.0 * np.pi) if scales.angle else 0.0
        changes |= {"middle": 0.5 * (low + high), "span": high - low, "turns": turns}
    return replace(scales, **changes)
