"""Resolution of a sensor."""

import math
from typing import Any

from idloop.physics.effect import OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Rounded to a multiple of the resolution."""
    if parameters[0] <= 0.0:
        return value
    return parameters[0] * math.floor(value / parameters[0] + 0.5)


EFFECT = Effect(
    name="sensor_quantisation",
    site=OUTPUT,
    text="The sensor reports steps: encoder counts, converter bits.",
    also_called=("quantisation", "quantization", "encoder_resolution", "resolution"),
    equation=EffectEquation("y_q", r"y_q = r\,\left\lfloor @y / r + \tfrac{1}{2} \right\rfloor", {"resolution": "r"}),
    parameters=(EffectParameter("resolution", "{output}", min=0.0),),
    reading=reading,
    final=True,
    resolution="resolution",
    looks_like=(),
)
