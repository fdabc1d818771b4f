"""Friction proportional to speed, in addition to that of the body."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-B w."""
    return -parameters[0] * velocity


EFFECT = Effect(
    name="viscous_friction",
    site=BODY,
    text="A drag proportional to speed: lubricant, eddy currents, back-EMF.",
    also_called=("damping", "viscous", "linear_damping", "friction"),
    equation=EffectEquation(r"-b\,@v", "", {"coefficient": "b"}),
    parameters=(EffectParameter("coefficient", "{force}·s/{position}", min=0.0),),
    force=force,
    proportional=True,
    site_parameter="viscous_friction",
    everyday=True,
    slow=True,
    linear=True,
    rate=lambda values, inertia, stiffness: values["coefficient"] / inertia,
    looks_like=("quadratic_drag",),
    trials=lambda s: alternatives("coefficient", [0.05 * s.force / s.speed]),
)
