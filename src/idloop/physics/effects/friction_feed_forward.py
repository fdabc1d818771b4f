"""Friction compensation in the drive's firmware, by the sign of the speed of the set-point."""

import math
from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives

# States: the low-passed set-point, the speed of the set-point, and whether there has been one.


@hook
def position_set_point(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Note the slope of a position set-point, low-passed: 0 at the first one."""
    state[1] = 0.0
    if state[2] != 0.0:
        state[1] = (value - state[0]) * math.exp(-elapsed / parameters[3]) / parameters[3]
    return value


@hook
def velocity_set_point(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Note a velocity set-point."""
    state[1] = value
    return value


@hook
def settle(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Low-pass the set-point, exact while it is held."""
    late = (state[0] - value) * math.exp(-elapsed / parameters[3]) if state[2] != 0.0 else 0.0
    state[0], state[2] = value + late, 1.0
    return 0.0


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = u + level tanh(r'/speed) + viscous r'."""
    return value + parameters[0] * math.tanh(state[1] / parameters[1]) + parameters[2] * state[1]


EFFECT = Effect(
    name="friction_feed_forward",
    site=INPUT,
    text="The drive's firmware adds an output of the sign of the set-point's speed: of it and the dry friction of an "
    "axis that follows closely only the difference shows, and both where the axis moves and the set-point stands.",
    also_called=("friction_feedforward", "velocity_feed_forward"),
    equation=EffectEquation(
        "u_c",
        r"u_c = @u + u_f\tanh\left(\dot{r}/v_f\right) + b_f\,\dot{r}\text{, }\dot{r}\text{ the speed of the set-point"
        r" behind a low-pass of }\tau_f",
        {"level": "u_f", "speed": "v_f", "viscous": "b_f", "time_constant": r"\tau_f"},
    ),
    parameters=(
        EffectParameter("level", "{input}"),
        EffectParameter("speed", "{position}/s", start=0.05, neutral=0.05, min=1e-6, held=True),
        EffectParameter("viscous", "{input}·s/{position}", held=True),
        EffectParameter("time_constant", "s", start=0.01, neutral=0.01, min=1e-4, chosen=True),
    ),
    command=command,
    set_point={"position_loop": position_set_point, "velocity_loop": velocity_set_point},
    settle=settle,
    states=3,
    rate=lambda values, inertia, stiffness: 1.0 / max(values["time_constant"], 1e-3),
    order=16,
    of_loop=True,
    suggest_order=95,
    looks_like=("coulomb_friction", "viscous_friction"),
    trials=lambda s: [
        group
        for r in (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
        for group in alternatives("level", [0.1 * s.command], speed=r * s.speed)
    ],
    not_cancelled="it follows the set-point of the drive, and no force is commanded",
)
