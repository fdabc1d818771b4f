"""Error of a sensor that repeats over the turn: tachometer ripple, encoder eccentricity."""

import math
from typing import Any

from idloop.physics.effect import OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import waves


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Y = x (1 + amplitude sin(n position + phase))."""
    return value * (1.0 + parameters[0] * math.sin(parameters[1] * position + parameters[2]))


EFFECT = Effect(
    name="sensor_ripple",
    site=OUTPUT,
    text="The sensor's gain varies over the turn: tachometer ripple, an eccentric encoder disc.",
    also_called=("tacho_ripple", "encoder_eccentricity", "ripple"),
    equation=EffectEquation(
        "y_r",
        r"y_r = @y\,\left(1 + a_r\sin(n_r\,@q + \varphi_r)\right)",
        {"amplitude": "a_r", "harmonic": "n_r", "phase": r"\varphi_r"},
    ),
    parameters=(
        EffectParameter("amplitude", "-", min=0.0, max=1.0),
        EffectParameter("harmonic", "-", start=1.0, neutral=1.0, min=1.0, integer=True),
        EffectParameter("phase", "rad", min=-7.0, max=7.0),
    ),
    reading=reading,
    order=50,
    looks_like=("cogging",),
    trials=lambda s: waves(0.02, s.repeating(range(1, 13))),
    needs_angle=True,
)
