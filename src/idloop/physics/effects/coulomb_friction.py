"""Dry friction with one level, with true sticking."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def friction(direction: float, speed: float, arriving: float, elapsed: float, state: Any, parameters: Any) -> float:
    """The same level at every speed and at breakaway."""
    return parameters[0]


EFFECT = Effect(
    name="coulomb_friction",
    site=BODY,
    text="Dry friction opposes motion with a constant level and holds the body at rest below it.",
    also_called=("dry_friction", "friction", "stiction", "frictionloss"),
    equation=EffectEquation(r"-@F_{\text{f}@i}", r"@F_{\text{f}@i} = f_c\,\operatorname{sign} @v", {"level": "f_c"}),
    parameters=(EffectParameter("level", "{force}", min=0.0),),
    friction=friction,
    proportional=True,
    dry_level="level",
    everyday=True,
    suggest_order=20,
    looks_like=("dead_zone", "stribeck_friction", "asymmetric_friction"),
    trials=lambda s: alternatives("level", [r * s.force for r in (0.03, 0.1, 0.3)]),
)
