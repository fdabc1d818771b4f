"""Constant added to a measurement."""

from typing import Any

from idloop.physics.effect import OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Y = x + offset."""
    return value + parameters[0]


EFFECT = Effect(
    name="sensor_offset",
    site=OUTPUT,
    text="The sensor reads a constant too much or too little.",
    also_called=("zero_offset", "encoder_offset", "offset"),
    equation=EffectEquation("y_o", "y_o = @y + o_y", {"offset": "o_y"}),
    parameters=(EffectParameter("offset", "{output}"),),
    reading=reading,
    order=60,
    hidden_by_start=True,
    trials=lambda s: alternatives("offset", [0.05 * s.output]),
)
