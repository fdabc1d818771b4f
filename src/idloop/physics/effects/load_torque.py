"""A constant torque or force on a body."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """A constant torque or force."""
    return parameters[0]


EFFECT = Effect(
    name="load_torque",
    site=BODY,
    text="A constant load pulls in one direction: a hanging weight, a preload.",
    also_called=("constant_load", "constant_force", "preload", "external_torque", "hanging_weight"),
    equation=EffectEquation("+@F_{0@i}", "", {"torque": "@F_{0@i}"}),
    parameters=(EffectParameter("torque", "{force}"),),
    force=force,
    proportional=True,
    looks_like=("input_offset",),
    slow=True,
    anywhere=True,
    weight=True,
    trials=lambda s: alternatives("torque", [0.05 * s.force]),
)
