"""A force that repeats several times per turn: magnets and slots."""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import waves


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-amplitude sin(n position + phase)."""
    return -parameters[0] * math.sin(parameters[1] * position + parameters[2])


EFFECT = Effect(
    name="cogging",
    site=BODY,
    text="The rotor is drawn to several angles of the turn: magnets against slots, gear mesh.",
    also_called=("detent", "detent_torque", "torque_ripple", "reluctance"),
    equation=EffectEquation(
        r"-a_n\sin(n\,@q + \varphi_n)", "", {"amplitude": "a_n", "harmonic": "n", "phase": r"\varphi_n"}
    ),
    parameters=(
        EffectParameter("amplitude", "{force}", min=0.0),
        EffectParameter("harmonic", "-", start=2.0, neutral=2.0, min=2.0, integer=True),
        EffectParameter("phase", "rad", min=-7.0, max=7.0),
    ),
    force=force,
    proportional=True,
    rate=lambda values, inertia, stiffness: (values["amplitude"] * values["harmonic"] / inertia) ** 0.5,
    spatial_rate=lambda values, inertia, stiffness: values["harmonic"],
    looks_like=("sensor_ripple",),
    trials=lambda s: waves(0.05 * s.force, s.repeating(s.harmonics or range(2, 25))),
    needs_angle=True,
    several=True,
)
