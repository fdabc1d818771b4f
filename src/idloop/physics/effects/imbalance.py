"""A force that repeats once per turn: off-centre mass, gravity on an arm."""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import waves


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-amplitude sin(position + phase)."""
    return -parameters[0] * math.sin(position + parameters[1])


EFFECT = Effect(
    name="imbalance",
    site=BODY,
    text="An off-centre mass pulls towards one angle of the turn: gravity on an arm, a lopsided slip ring.",
    also_called=("unbalance", "eccentricity", "off_centre_mass"),
    equation=EffectEquation(r"-a_1\sin(@q + \varphi_1)", "", {"amplitude": "a_1", "phase": r"\varphi_1"}),
    parameters=(
        EffectParameter("amplitude", "{force}", min=0.0),
        EffectParameter("phase", "rad", min=-7.0, max=7.0),
    ),
    force=force,
    proportional=True,
    rate=lambda values, inertia, stiffness: (values["amplitude"] / inertia) ** 0.5,
    spatial_rate=lambda values, inertia, stiffness: 1.0,
    whole_turn=True,
    suggest_order=60,
    looks_like=("input_offset", "cable_spring"),
    trials=lambda s: waves(0.05 * s.force),
    needs_angle=True,
)
