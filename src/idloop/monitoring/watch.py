"""Watches: a parameter of the model and the growth to detect."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from idloop.errors import InputError
from idloop.physics.effect import BODY, COUPLING
from idloop.spelling import did_you_mean_or_known, listed

if TYPE_CHECKING:
    from idloop.physics import Model

# Default growth to detect, as a share of the parameter's value.
USUAL_GROWTH = 0.2


@dataclass(frozen=True)
class Watch:
    """A parameter and its growth to detect."""

    parameter: str  # name in the model, such as ``coulomb_friction@motor.level``
    value: float  # value in the model [unit]
    growth: float  # change to detect [unit], not 0; negative where wear reduces the parameter, such as a stiffness
    unit: str  # unit of the parameter


def parse_watch(model: Model, text: str) -> Watch:
    """Parse a watch.

    `text`: ``EFFECT@SITE`` (its only or first parameter), ``EFFECT@SITE.PARAMETER`` or ``BODY.viscous_friction``; then,
    if wanted, ``=20%`` or ``=0.02``, the growth as a share of the value or in the parameter's unit. Raises InputError:
    the model has no such parameter, the growth is no number or 0, or it violates the bounds of the parameter.
    """
    name, equals, amount = (part.strip() for part in text.partition("="))
    parameter = model.parameter(_full_name(model, name))
    growth = _growth(text, amount if equals else f"{100 * USUAL_GROWTH:g}%", parameter.value)
    if growth == 0.0:
        raise InputError(
            f"watch {text}: {parameter.name} is {parameter.value:g} {parameter.unit} in the model; give the growth in "
            f"{parameter.unit}, such as {parameter.name}=0.01"
        )
    if not parameter.min <= parameter.value + growth <= parameter.max:
        raise InputError(
            f"watch {text}: {parameter.name} would be {parameter.value + growth:g}, outside {parameter.min:g} .. "
            f"{parameter.max:g} {parameter.unit}"
        )
    return Watch(parameter.name, parameter.value, growth, parameter.unit)


def choose_watches(model: Model, texts: Sequence[str]) -> tuple[Watch, ...]:
    """Parse watches; without any, take the dry friction and the effects in couplings that the model has.

    `texts`: as `parse_watch` reads them. Raises InputError: as `parse_watch`; a parameter is named twice, or there is
    nothing to watch.
    """
    found = [parse_watch(model, text) for text in texts or _worn(model)]
    names = [watch.parameter for watch in found]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"watch {twice[0]}: named twice")
    if not found:
        raise InputError(
            f"model {model.name} has no dry friction and no effect in a coupling to watch: add an effect to the "
            f"model, or name a parameter, one of {listed(model.values)}"
        )
    return tuple(found)


def may_vary(model: Model, watches: Sequence[Watch], more: Iterable[str] = ()) -> tuple[str, ...]:
    """Parameters whose change is not wear: viscous friction, which depends on the temperature, and others.

    `watches`: their parameters are left out; `more`: further parameters of the model. Raises InputError: the model has
    no such parameter.
    """
    losses = {name for body in model.bodies for name in model.equivalent_parameters(f"{body}.viscous_friction")}
    viscous = [p.name for p in model.parameters if p.name in losses and p.value > 0.0]
    watched = {watch.parameter for watch in watches}
    further = [model.parameter(name).name for name in more]
    return tuple(dict.fromkeys(name for name in (*viscous, *further) if name not in watched))


def _full_name(model: Model, name: str) -> str:
    """Name of a parameter; the name of an effect means its first parameter."""
    for active in model.effects:
        if active.name == name:
            return f"{name}.{active.effect.parameters[0].name}"
    if name not in model.values:
        known = [p.name for p in model.parameters]
        effect = name.partition(".")[0]
        if "@" in effect and effect not in model.effect_names:
            raise InputError(
                f"watch {name}: model {model.name} has no effect {effect}"
                f"{did_you_mean_or_known(effect, model.effect_names)}; add it with --effect '{effect}(...)'"
            )
        raise InputError(f"watch {name}: model {model.name} has no such parameter{did_you_mean_or_known(name, known)}")
    return name


def _growth(text: str, amount: str, value: float) -> float:
    try:
        growth = float(amount.removesuffix("%"))
    except ValueError:
        raise InputError(f"watch {text}: the growth {amount!r} is no number; write 20% or 0.02") from None
    if not np.isfinite(growth):
        raise InputError(f"watch {text}: the growth must be finite")
    return abs(value) * growth / 100.0 if amount.endswith("%") else growth


def _worn(model: Model) -> list[str]:
    """Effects of dry friction and in couplings whose first parameter is not 0."""
    return [
        active.name
        for active in model.effects
        if (active.effect.site == BODY and active.effect.friction is not None) or active.effect.site == COUPLING
        if model.values[f"{active.name}.{active.effect.parameters[0].name}"] != 0.0
    ]
