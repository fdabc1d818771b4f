"""Commands too small to act: dead zone of a motor or amplifier."""

from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = 0 for -width_negative <= u <= width, else u minus the width passed."""
    if value > parameters[0]:
        return value - parameters[0]
    if value < -parameters[1]:
        return value + parameters[1]
    return 0.0


@hook
def undo(value: float, velocity: float, side: float, elapsed: float, state: Any, parameters: Any) -> float:
    """U = v + width sign v, the sign smooth: a jump at zero would turn noise into chatter."""
    return value + (parameters[0] if side > 0.0 else parameters[1]) * side


EFFECT = Effect(
    name="dead_zone",
    site=INPUT,
    text="Small commands do nothing and larger ones act only with what exceeds the width.",
    also_called=("deadband", "dead_band", "deadzone"),
    equation=EffectEquation(
        "u_d", r"u_d = @u - \min\left(\max\left(@u, -d_-\right), d\right)", {"width": "d", "width_negative": "d_-"}
    ),
    parameters=(
        EffectParameter("width", "{input}", min=0.0),
        EffectParameter("width_negative", "{input}", min=0.0, optional="width"),
    ),
    command=command,
    undo=undo,
    order=50,
    odd=True,
    everyday=True,
    suggest_order=10,
    looks_like=("coulomb_friction",),
    trials=lambda s: alternatives("width", [r * s.command for r in (0.02, 0.05, 0.12, 0.3, 0.6)]),
)
