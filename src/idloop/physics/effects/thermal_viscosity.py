"""Viscous friction that changes with the temperature: a lubricant that thins as it warms.

To first order about a reference temperature, as in Simoni, Beschi, Legnani and Visioli, On the inclusion of
temperature in the friction model of industrial robots, IFAC World Congress 2017. Of oil and grease the viscosity falls
exponentially; over tens of kelvins a line approximates it. Valid between the temperatures of the record.
"""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-b (T - T0) w, beside the viscous friction at T0."""
    return -parameters[0] * state[0] * velocity


EFFECT = Effect(
    name="thermal_viscosity",
    site=BODY,
    text="Viscous friction changes with the measured temperature: oil and grease thin as they warm.",
    also_called=("temperature_viscosity", "temperature_friction"),
    equation=EffectEquation(
        r"-@F_{\theta@i}",
        r"@F_{\theta@i} = b_{\theta}\,(\Theta - \Theta_0)\,@v\text{, }\text{beside the viscous friction at }\Theta_0",
        {"coefficient": r"b_{\theta}", "reference": r"\Theta_0"},
    ),
    parameters=(
        EffectParameter("coefficient", "{force}·s/{position}/K"),
        EffectParameter("reference", "°C", start=20.0, neutral=20.0, min=-273.15, chosen=True),
    ),
    force=force,
    proportional=True,
    states=1,
    condition="temperature",
    reference="reference",
    slow=True,
    rate=lambda values, inertia, stiffness: 100.0 * abs(values["coefficient"]) / inertia,
    looks_like=("viscous_friction", "thermal_dry_friction"),
    trials=lambda s: alternatives("coefficient", [-0.003 * s.force / s.speed], reference=s.about("temperature", 20.0)),
    not_cancelled="the compensator has no measurement of the temperature",
)
