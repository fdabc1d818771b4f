"""Dry friction that changes with the temperature: seals that soften, a preload that grows or goes.

To first order about a reference temperature, see `thermal_viscosity`. It holds between the temperatures that it was
found at.
"""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def friction(direction: float, speed: float, arriving: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Slope times T - T0, beside the dry friction at T0."""
    return parameters[0] * state[0]


EFFECT = Effect(
    name="thermal_dry_friction",
    site=BODY,
    text="Dry friction changes with the measured temperature: seals soften, a preload grows or goes.",
    also_called=("temperature_friction",),
    equation=EffectEquation(
        r"-@F_{\text{f}@i}",
        r"@F_{\text{f}@i} = f_{\theta}\,(\Theta - \Theta_0)\operatorname{sign} @v\text{, }"
        r"\text{beside the dry friction at }\Theta_0",
        {"slope": r"f_{\theta}", "reference": r"\Theta_0"},
    ),
    parameters=(
        EffectParameter("slope", "{force}/K"),
        EffectParameter("reference", "°C", start=20.0, neutral=20.0, min=-273.15, chosen=True),
    ),
    friction=friction,
    proportional=True,
    states=1,
    condition="temperature",
    reference="reference",
    looks_like=("coulomb_friction", "thermal_viscosity"),
    trials=lambda s: alternatives("slope", [-0.003 * s.force], reference=s.about("temperature", 20.0)),
    not_cancelled="the compensator has no measurement of the temperature",
)
