"""Effects whose strength the data do not determine: their evidence is that of something else."""

from __future__ import annotations

import math

from idloop.diagnosis.screening.proposals import Proposal
from idloop.physics.effect import Effect
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter
from idloop.validation.words import short

# Standard errors from its neutral value within which the strength of an effect may be none.
CERTAIN = 2.0
# Factor by which an effect grows beside another one that cancels it.
_CANCELLED = 100.0


def undetermined_with(parent: Model, model: Model, proposal: Proposal) -> str:
    """Say that the data do not determine an effect, or another one beside it any more; empty where they do.

    The interval of the other one then contains both none and what it was before. One that is superfluous beside the new
    effect is none with certainty. Two that cancel each other grow without limit: their difference alone shows.

    Parameters
    ----------
    parent, model : Model
        Fitted without the effect and with it, with standard errors.
    proposal : Proposal
        The effect.
    """
    if proposal.replaces is None and (own := undetermined_strength(model, proposal.name, proposal.effect)):
        return f"the data do not determine its {own}"
    for contained, known in _contained(parent, proposal).items():
        if own := _undetermined_addition(model, proposal, known):
            return f"the data do not determine what it adds to {contained}, its {own}"
    for active in parent.effects:
        strength = active.effect.strength
        key = f"{active.name}.{strength}"
        if not strength or active.name not in model.effect_names or key not in model.free:
            continue
        before, found = parent.parameter(key), model.parameter(key)
        if abs(found.value) > _CANCELLED * abs(before.value) > _CANCELLED * CERTAIN * _error(before):
            return f"beside it {active.name} grows to a {strength} of {short(found.value)}: only their difference shows"
        reach = CERTAIN * _error(found)
        neutral = active.effect.spec(strength).neutral
        if (
            abs(before.value - neutral) > CERTAIN * _error(before)
            and abs(found.value - neutral) <= reach
            and abs(found.value - before.value) <= reach
        ):
            return f"beside it the data do not determine {active.name} any more, its {_with_error(strength, found)}"
    return ""


def undetermined_strength(fitted: Model, name: str, effect: Effect) -> str:
    """The parameter that shows that the data do not determine an effect, with its value; empty where they do.

    The interval of its strength, or of its first parameter where it has no strength, contains the neutral value; or the
    interval of a parameter contains its whole range. So it is where an offset and the phase of a wave are confounded.
    """
    for spec in effect.parameters:
        key = f"{name}.{spec.name}"
        if spec.optional or key not in fitted.free:
            continue
        found = fitted.parameter(key)
        reach = CERTAIN * _error(found)
        # An interval of a stiffness that contains zero contains the rigid coupling as well.
        neutral = spec.neutral if math.isfinite(spec.neutral) else 0.0
        none = spec.name == (effect.strength or effect.parameters[0].name) and abs(found.value - neutral) <= reach
        if none or (found.value - reach <= spec.min and spec.max <= found.value + reach):
            return _with_error(spec.name, found)
    return ""


def is_none(fitted: Model, name: str) -> bool:
    """Whether an effect has ended at the value at which it does nothing."""
    effect = next(active.effect for active in fitted.effects if active.name == name)
    return bool(effect.strength) and fitted.values[f"{name}.{effect.strength}"] == effect.spec(effect.strength).neutral


def _contained(parent: Model, proposal: Proposal) -> dict[str, set[str]]:
    """Parameters that an effect shares with what it replaces, else with each effect that it contains."""
    nested = {name: set(shared.values()) for name, shared in proposal.effect.contains.items()}
    if proposal.replaces is None:
        return nested
    own = {name.removeprefix(f"{proposal.name}.") for name in parent.free if proposal.replaces == proposal.name}
    return {proposal.replaces: own | nested.get(proposal.replaces.partition("@")[0].partition("#")[0], set())}


def _undetermined_addition(fitted: Model, proposal: Proposal, known: set[str]) -> str:
    """The parameters of an effect beside the known ones; empty where the data determine any of them."""
    found = []
    for spec in proposal.effect.parameters:
        key = f"{proposal.name}.{spec.name}"
        if key not in fitted.free or spec.name in known:
            continue
        parameter = fitted.parameter(key)
        if abs(parameter.value - (spec.neutral if math.isfinite(spec.neutral) else 0.0)) > CERTAIN * _error(parameter):
            return ""
        found.append(_with_error(spec.name, parameter))
    return ", ".join(found)


def _error(found: Parameter) -> float:
    """The standard error; infinite for what the data do not determine at all."""
    return math.inf if found.stderr is None else found.stderr


def _with_error(name: str, found: Parameter) -> str:
    error, unit = _error(found), "" if found.unit in ("", "-") else f" {found.unit}"
    known = f"a standard error of {short(error)}{unit}" if math.isfinite(error) else "no finite standard error"
    return f"{name}: {short(found.value)}{unit} with {known}"
