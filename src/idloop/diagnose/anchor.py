"""A fit that has left the user's machine far behind, taken up again from near it.

Beside a missing effect that rules the motion, a likelihood may prefer a machine that its drive hardly moves, a
hundred times too heavy or with a gain of nothing, and a disturbance that does everything. From there no effect
promises much. The user's own values are no truth, but they are of the right size: held near them, the model is worse
by itself and shows what it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from idloop.diagnose.confirm import Confirmed, confirm, promising
from idloop.diagnose.ends import ends
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.scales import Sizes
from idloop.diagnose.screen import Screen
from idloop.estimate.likelihood.refit import Refit, refit_or_none
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.effect import COUPLING, INPUT
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter
from idloop.physics.schema import BODY_PARAMETERS, COUPLING_PARAMETERS

# A mass or a stiffness that the fit has changed by this factor is not the user's any more.
LEFT_BEHIND = 5.0
# How far from the user's values the model may go when it is held near them.
_NEAR = 3.0
# Searches from the very values of the user that are carried on after a first round.
_CARRIED_ON = 2
_SIZES, _GAIN = ("inertia", "stiffness"), "drive.gain"


def left_behind(model: Model, given: Mapping[str, float]) -> bool:
    """Whether a free inertia or stiffness is far from what the user gave.

    Parameters
    ----------
    model : Model
        Fitted.
    given : mapping
        Values of the model's parameters as the user gave them.
    """
    return bool(_left(model, given))


def from_near(
    setting: Setting, parent: Refit, given: Mapping[str, float], effects: Sequence[str] | None, seed: int
) -> list[Confirmed]:
    """Effects refitted from where the model is best near the user's values.

    Parameters
    ----------
    setting : Setting
    parent : Refit
        The fit that went far away.
    given : mapping
    effects : sequence of str, optional
        Choose from these only.
    seed : int

    Returns
    -------
    list of Confirmed
        All that were tried, best first; their gain is that above the parent, and may be below 0.
    """
    start = _held_near(setting, parent.model, given)
    if start is None:
        return []
    screened = Screen(setting, start, seed).all(proposals(start.model, effects, setting.conditions))
    chosen = promising(screened, 2.0 * math.log(max(len(screened), 1)))
    # A score says little of what begins at a level, of a joint whose spring is far from its right stiffness, or of a
    # delay of many samples.
    chosen += [s for s in screened if s.traces and s not in chosen and _strange_to_scores(s.proposal)]
    # What is still behind the fit far away after a first round is not searched to its end.
    found = confirm(setting, start, chosen, matters=lambda c: c.fit.log_likelihood > parent.log_likelihood)
    if all(c.fit.log_likelihood <= parent.log_likelihood for c in found):
        for proposal in proposals(parent.model, effects, setting.conditions):
            if _begins_at_the_users(parent.model, given, proposal):
                found += _from_the_users(setting, parent, proposal, given)
    gains = [replace(c, gain=c.fit.log_likelihood - parent.log_likelihood) for c in found]
    return sorted(gains, key=lambda c: -c.gain)


def _begins_at_the_users(model: Model, given: Mapping[str, float], proposal: Proposal) -> bool:
    """Whether an effect is one of a coupling whose stiffness the fit has left, or of the drive where it has left that.

    A coupling that slips all the time is nowhere near the user's values without its slip, nor is a drive that answers
    late without its delay.
    """
    if proposal.replaces is not None:
        return False
    if proposal.effect.site == COUPLING:
        return f"{proposal.at}.stiffness" in _left(model, given)
    of_the_drive = proposal.effect.site == INPUT or bool(proposal.effect.delay)
    return of_the_drive and _GAIN in model.free and abs(model.values[_GAIN]) < abs(given.get(_GAIN, 0.0)) / LEFT_BEHIND


def _from_the_users(setting: Setting, parent: Refit, proposal: Proposal, given: Mapping[str, float]) -> list[Confirmed]:
    """Where the best search with an effect ends that starts from the very values the user gave."""
    near = {**parent.model.values, **given}
    scales = Sizes(parent.model.with_values(near), setting).at(proposal.effect.site, proposal.at)
    trials = [trial for alternative in proposal.alternatives(scales) for trial in alternative]
    choices = [{**near, **{f"{proposal.name}.{name}": v for name, v in trial.items()}} for trial in trials]
    fits = ends(setting, proposal.model(trials[0]), choices, most=_CARRIED_ON)
    return [Confirmed(proposal, fit, 0.0, 0.0) for fit in fits[:1]]


def _left(model: Model, given: Mapping[str, float]) -> list[str]:
    """Inertias and stiffnesses that are far from what the user gave."""
    shares = {name: model.values[name] / given[name] for name in _linear(model, given, _SIZES)}
    return [name for name, share in shares.items() if not 1.0 / LEFT_BEHIND < share < LEFT_BEHIND]


def _strange_to_scores(proposal: Proposal) -> bool:
    strange = proposal.effect.site == COUPLING or proposal.effect.from_a_level or proposal.effect.delay
    return proposal.replaces is None and bool(strange)


def _linear(model: Model, given: Mapping[str, float], kinds: Sequence[str]) -> list[str]:
    """Free parameters of bodies and couplings of some kinds whose value the user gave."""
    return [
        name
        for name in model.free
        if "@" not in name and name.rpartition(".")[2] in kinds and given.get(name, 0.0) > 0.0
    ]


def _near(parameter: Parameter, given: float) -> Parameter:
    low, high = sorted((given / _NEAR, given * _NEAR))
    return replace(parameter, min=max(parameter.min, low), max=min(parameter.max, high))


def _held_near(setting: Setting, model: Model, given: Mapping[str, float]) -> Refit | None:
    """The model at its best near the user's values; free to leave them again."""
    names = _linear(model, given, (*BODY_PARAMETERS, *COUPLING_PARAMETERS))
    if _GAIN in model.free and given.get(_GAIN, 0.0) != 0.0:
        names.append(_GAIN)
    start = model.with_values({name: given[name] for name in names})
    held = tuple(_near(p, given[p.name]) if p.name in names else p for p in start.parameters)
    fit = refit_or_none(setting, replace(start, parameters=held))
    return None if fit is None else replace(fit, model=model.with_values(fit.model.values))
