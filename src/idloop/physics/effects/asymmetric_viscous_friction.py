"""Viscous friction that differs between the two directions of motion."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-coefficient abs(w): on top of the viscous friction, more one way and less the other."""
    return -parameters[0] * abs(velocity)


EFFECT = Effect(
    name="asymmetric_viscous_friction",
    site=BODY,
    text="The drag that grows with speed is higher in one direction of motion: a worn screw or nut.",
    also_called=("directional_damping",),
    equation=EffectEquation(r"-@F_{\text{a}@i}", r"@F_{\text{a}@i} = b_a\,\left|@v\right|", {"coefficient": "b_a"}),
    parameters=(EffectParameter("coefficient", "{force}·s/{position}"),),
    force=force,
    proportional=True,
    rate=lambda values, inertia, stiffness: abs(values["coefficient"]) / inertia,
    degenerates_to=("input_offset", "load_torque"),
    looks_like=("asymmetric_friction", "gain_asymmetry"),
    trials=lambda s: alternatives("coefficient", [0.05 * s.force / s.speed]),
)
