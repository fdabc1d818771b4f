"""A drive that pushes less when its supply sags: a voltage stage whose gain is that of the supply."""

import math
from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = u (U / U0)^share; a supply that is gone drives nothing."""
    share = parameters[0]
    if share == 0.0 or state[0] == 0.0:
        return value
    ratio = 1.0 + state[0] / parameters[1]
    return value * math.exp(share * math.log(ratio)) if ratio > 0.0 else 0.0


EFFECT = Effect(
    name="supply_sag",
    site=INPUT,
    text="The drive pushes less when the measured supply sags: share 1 of a plain voltage or PWM stage, "
    "0 where current is controlled.",
    also_called=("battery_sag", "voltage_drop", "sag"),
    equation=EffectEquation(
        "u_b",
        r"u_b = @u\left(\frac{U_s}{U_0}\right)^\kappa\text{, }U_s\text{ the measured supply}",
        {"share": r"\kappa", "reference": "U_0"},
    ),
    parameters=(
        EffectParameter("share", "-", min=0.0, max=2.0),
        EffectParameter("reference", "V", start=24.0, neutral=24.0, min=1e-3, chosen=True),
    ),
    command=command,
    states=1,
    condition="supply",
    reference="reference",
    order=55,
    looks_like=("saturation",),
    trials=lambda s: alternatives("share", [0.5], reference=s.about("supply", 24.0)),
    not_cancelled="the compensator has no measurement of the supply",
)
