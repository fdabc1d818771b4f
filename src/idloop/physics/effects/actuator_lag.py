"""First-order lag of the drive."""

import math
from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives, time_constants


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Tau dv/dt = u - v, exact while u is held."""
    if parameters[0] <= 0.0:
        return value
    return value + (state[0] - value) * math.exp(-elapsed / parameters[0])


@hook
def settle(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Keep the drive's output at the end of the step."""
    if parameters[0] <= 0.0:
        state[0] = value
    else:
        state[0] = value + (state[0] - value) * math.exp(-elapsed / parameters[0])
    return state[0]


EFFECT = Effect(
    name="actuator_lag",
    site=INPUT,
    text="The drive follows a new command gradually, with one time constant: current loop or winding.",
    also_called=("motor_lag", "electrical_time_constant", "current_loop", "inductance", "first_order_lag"),
    equation=EffectEquation(r"u_{\ell}", r"\tau_a\,\dot{u}_{\ell} = @u - u_{\ell}", {"time_constant": r"\tau_a"}),
    parameters=(EffectParameter("time_constant", "s", min=0.0, max=10.0),),
    command=command,
    settle=settle,
    states=1,
    order=60,
    rate=lambda values, inertia, stiffness: 1.0 / max(values["time_constant"], 1e-3),
    passes_constants=True,
    looks_like=("input_delay",),
    trials=lambda s: alternatives("time_constant", time_constants(s)),
    not_cancelled="its inverse amplifies the noise of the loop; the controller has to allow for it",
)
