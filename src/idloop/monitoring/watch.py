"""What is asked of a monitor: a parameter with the growth to detect, and the time between two false alarms."""

from __future__ import annotations

import re
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


HOURS = {"s": 1.0 / 3600.0, "min": 1.0 / 60.0, "h": 1.0, "d": 24.0, "day": 24.0, "days": 24.0, "week": 168.0}
HOURS |= {"weeks": 168.0, "year": 8766.0, "years": 8766.0}
# Running time: half a year of day shifts.
USUAL_HOURS = 1000.0

_FORM = re.compile(r"(?:(?:1|one)?\s*per\s+)?([0-9.eE+]+)?\s*([a-z]+)", re.IGNORECASE)


def parse_false_alarms(text: str) -> float:
    """Mean running time between two false alarms.

    `text`: ``per 1000 h``, ``1000 h``, ``per year``; the units are s, min, h, days, weeks, years. Returns: positive
    [h]. Raises InputError: it is not of that form.
    """
    found = _FORM.fullmatch(text.strip())
    try:
        count = float(found.group(1) or 1.0) if found else 0.0
    except ValueError:
        count = 0.0
    unit = found.group(2).lower() if found else ""
    if unit not in HOURS or not 0.0 < count < float("inf"):
        raise InputError(
            f"false alarms {text!r}: write the running time between two of them, such as 'per 1000 h' or 'per 30 days'"
        )
    return count * HOURS[unit]
