"""Friction compensation in the drive's firmware, by the sign of the measured speed."""

import math
from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = u + level tanh(w/speed) + viscous w."""
    return value + parameters[0] * math.tanh(velocity / parameters[1]) + parameters[2] * velocity


@hook
def undo(value: float, velocity: float, side: float, elapsed: float, state: Any, parameters: Any) -> float:
    """U = v - level tanh(w/speed) - viscous w."""
    return value - parameters[0] * math.tanh(velocity / parameters[1]) - parameters[2] * velocity


EFFECT = Effect(
    name="friction_compensation",
    site=INPUT,
    text="The drive's firmware adds an output of the sign of the measured speed: a negative dry friction; beyond its "
    "smoothing speed only the difference to that of the axis shows.",
    also_called=("friction_cancellation", "stiction_compensation"),
    equation=EffectEquation(
        "u_c",
        r"u_c = @u + u_f\tanh\left(@v/v_f\right) + b_f\,@v",
        {"level": "u_f", "speed": "v_f", "viscous": "b_f"},
    ),
    parameters=(
        EffectParameter("level", "{input}", min=0.0),
        EffectParameter("speed", "{position}/s", start=0.05, neutral=0.05, min=1e-6),
        # Its force is a negative viscous friction for any motion, so that no data show it.
        EffectParameter("viscous", "{input}·s/{position}", chosen=True),
    ),
    command=command,
    undo=undo,
    rate=lambda values, inertia, stiffness: abs(values["level"]) / values["speed"] / inertia,
    order=15,
    of_loop=True,
    suggest_order=95,
    looks_like=("coulomb_friction", "stribeck_friction", "viscous_friction"),
    trials=lambda s: [
        group for r in (0.02, 0.1, 0.3) for group in alternatives("level", [0.1 * s.command], speed=r * s.speed)
    ],
)
