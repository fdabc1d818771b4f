"""A speed sensor that counts pulses and so loses the direction of rotation."""

from typing import Any

from idloop.physics import Effect, EffectEquation, hook


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Y = abs(x)."""
    return abs(value)


EFFECT = Effect(
    name="sign_blind_sensor",
    site="output",
    text="The sensor counts pulses without their order, so it reports the size of the speed and not its sign.",
    equation=EffectEquation("y_b", r"y_b = \left|@y\right|"),
    parameters=(),
    reading=reading,
    order=55,
    outputs=("velocity",),
)
