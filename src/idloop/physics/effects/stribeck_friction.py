"""Dry friction that falls from a static to a kinetic level as speed rises."""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook

# Beyond so many Stribeck velocities the exponential is below the last digit of a double.
_FAST = 7.0


@hook
def friction(direction: float, speed: float, arriving: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Coulomb + (static - coulomb) exp(-(w/velocity)^2)."""
    ratio = speed / parameters[2]
    if ratio > _FAST:
        return parameters[0]
    return parameters[0] + (parameters[1] - parameters[0]) * math.exp(-ratio * ratio)


EFFECT = Effect(
    name="stribeck_friction",
    site=BODY,
    text="Breaking away takes more force than sliding: dry friction falls as the surfaces start to move.",
    also_called=("stiction", "static_friction", "breakaway", "stribeck"),
    equation=EffectEquation(
        r"-@F_{\text{f}@i}",
        r"@F_{\text{f}@i} = \left(f_c + (f_s - f_c)\,e^{-(@v/v_s)^2}\right)\operatorname{sign} @v",
        {"coulomb": "f_c", "static": "f_s", "velocity": "v_s"},
    ),
    parameters=(
        EffectParameter("coulomb", "{force}", min=0.0),
        EffectParameter("static", "{force}", min=0.0),
        EffectParameter("velocity", "{position}/s", start=0.1, min=1e-6),
    ),
    friction=friction,
    rate=lambda values, inertia, stiffness: abs(values["static"] - values["coulomb"]) / values["velocity"] / inertia,
    suggest_order=80,
    looks_like=("coulomb_friction", "quadratic_drag"),
    trials=lambda s: [
        [
            {"coulomb": s.dry, "static": s.dry + 0.1 * s.force, "velocity": r * s.speed},
            *([] if s.dry else [{"coulomb": 0.1 * s.force, "static": 0.1 * s.force, "velocity": r * s.speed}]),
        ]
        for r in (0.02, 0.1, 0.4)
    ],
    contains={"coulomb_friction": {"level": "coulomb"}},
    separable=True,
    valid=lambda values: values["static"] >= values["coulomb"],
)
