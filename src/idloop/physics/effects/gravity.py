"""Weight of an off-centre mass whose lowest position is known."""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-moment sin(position - lowest)."""
    return -parameters[0] * math.sin(position - parameters[1])


EFFECT = Effect(
    name="gravity",
    site=BODY,
    text="The weight of an arm or a pendulum pulls it to its lowest position: the sensor's zero, or the given angle.",
    also_called=("weight", "pendulum", "gravity_load"),
    equation=EffectEquation(r"-M_{g@i}\sin(@q - \varphi_0)", "", {"moment": "M_{g@i}", "lowest": r"\varphi_0"}),
    parameters=(
        EffectParameter("moment", "{force}"),
        EffectParameter("lowest", "rad", min=-7.0, max=7.0, held=True),
    ),
    force=force,
    proportional=True,
    rate=lambda values, inertia, stiffness: (abs(values["moment"]) / inertia) ** 0.5,
    spatial_rate=lambda values, inertia, stiffness: 1.0,
    looks_like=("imbalance", "cable_spring"),
    trials=lambda s: alternatives("moment", [0.05 * s.force]),
    weight=True,
    needs_angle=True,
)
