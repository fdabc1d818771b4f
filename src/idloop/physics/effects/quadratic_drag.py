"""Drag that grows with the square of speed."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-c abs(w) w."""
    return -parameters[0] * abs(velocity) * velocity


EFFECT = Effect(
    name="quadratic_drag",
    site=BODY,
    text="A drag that grows with the square of speed (fan, propeller, churning oil); below zero, viscous friction that"
    " levels off, as that of grease in a harmonic drive, within the speeds of the records.",
    also_called=("drag", "air_drag", "aerodynamic_drag", "fan"),
    equation=EffectEquation(r"-c\,\left|@v\right|@v", "", {"coefficient": "c"}),
    parameters=(EffectParameter("coefficient", "{force}·s²/{position}²"),),
    force=force,
    proportional=True,
    looks_like=("viscous_friction", "stribeck_friction"),
    trials=lambda s: alternatives("coefficient", [0.05 * s.force / s.speed**2]),
)
