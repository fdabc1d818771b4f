"""Dry friction that grows with the torque carried: gears, screws."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def friction(direction: float, speed: float, arriving: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Ratio abs(torque that arrives at the body)."""
    return parameters[0] * arriving


EFFECT = Effect(
    name="load_dependent_friction",
    site=BODY,
    text="The harder the teeth or threads press, the higher their dry friction.",
    also_called=("load_friction", "mesh_friction"),
    equation=EffectEquation(
        r"-@F_{\text{f}@i}",
        r"@F_{\text{f}@i} = \mu\,\left|@F_{\text{in}}\right|\operatorname{sign} @v\text{, } @F_{\text{in}} "
        r"\text{ what the drive or the coupling before passes on}",
        {"ratio": r"\mu"},
    ),
    parameters=(EffectParameter("ratio", "-", min=0.0, max=0.99),),
    friction=friction,
    looks_like=("coulomb_friction",),
    trials=lambda s: alternatives("ratio", [0.03, 0.1, 0.3]),
)
