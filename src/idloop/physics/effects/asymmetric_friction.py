"""Dry friction that differs between the two directions of motion."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook


@hook
def friction(direction: float, speed: float, arriving: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Level (1 + ratio sign w)."""
    return parameters[0] * (1.0 + parameters[1] * direction)


EFFECT = Effect(
    name="asymmetric_friction",
    site=BODY,
    text="Dry friction is higher in one direction of motion than in the other: a worn screw, a preloaded bearing.",
    also_called=("directional_friction",),
    equation=EffectEquation(
        r"-@F_{\text{f}@i}",
        r"@F_{\text{f}@i} = f_c\,(1 + \rho\,\operatorname{sign} @v)\,\operatorname{sign} @v",
        {"level": "f_c", "ratio": r"\rho"},
    ),
    parameters=(
        EffectParameter("level", "{force}", min=0.0),
        EffectParameter("ratio", "-", min=-1.0, max=1.0),
    ),
    friction=friction,
    proportional=True,
    same_as=("coulomb_friction", "load_torque"),  # level sign v + level ratio, at rest too
    by_hand={
        "load_torque": "mount the axis the other way round or take the load off, a load turns its sign or goes, "
        "friction stays",
        "input_offset": "zero the amplifier, an offset goes, friction stays",
    },
    looks_like=("input_offset", "load_torque"),
    trials=lambda s: [
        [{"level": s.dry, "ratio": 0.1}]
        if s.dry
        else [{"level": 0.1 * s.force, "ratio": ratio} for ratio in (0.3, -0.3)]
    ],
    contains={"coulomb_friction": {"level": "level"}},
)
