"""Low-pass inside the drive's own velocity estimate."""

import math
from typing import Any

from idloop.physics.effect import OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives, time_constants


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """The filter's output; without a time constant, the input."""
    if parameters[0] <= 0.0 or state[2] == 0.0:
        return value
    return state[0]


@hook
def settle(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Tau dz/dt = x - z, exact while x changes linearly over the step."""
    tau = parameters[0]
    if state[2] == 0.0 or tau <= 0.0:  # a filter that has run for long at the first value
        state[0] = value
        state[1] = value
        state[2] = 1.0
        return value
    if elapsed > 0.0:
        slope = (value - state[1]) / elapsed
        lag = state[0] - state[1] + slope * tau
        state[0] = value - slope * tau + lag * math.exp(-elapsed / tau)
        state[1] = value
    return state[0]


EFFECT = Effect(
    name="velocity_filter",
    site=OUTPUT,
    text="The drive smooths its own velocity estimate, so the measured velocity lags.",
    also_called=("low_pass", "speed_filter"),
    equation=EffectEquation("y_f", r"\tau_f\,\dot{y}_f = @y - y_f", {"time_constant": r"\tau_f"}),
    parameters=(EffectParameter("time_constant", "s", min=0.0, max=10.0),),
    reading=reading,
    settle=settle,
    states=3,
    order=20,
    outputs=("velocity",),
    looks_like=("sensor_delay",),
    trials=lambda s: alternatives("time_constant", time_constants(s)),
)
