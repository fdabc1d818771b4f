"""Limit of the command inside the drive."""

from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives

# Of the largest command; the smallest for a controller that winds up and asks for many times what the drive gives.
SHARES = (0.97, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1, 0.04, 0.015)


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = clip(u, -limit, +limit)."""
    return min(max(value, -parameters[0]), parameters[0])


EFFECT = Effect(
    name="saturation",
    site=INPUT,
    text="Commands above the limit have no more effect than the limit itself.",
    also_called=("limit", "current_limit", "torque_limit", "voltage_limit", "clipping"),
    equation=EffectEquation(
        "u_s", r"u_s = \min\left(\max\left(@u, -u_{\max}\right), u_{\max}\right)", {"limit": r"u_{\max}"}
    ),
    parameters=(EffectParameter("limit", "{input}", start=float("inf"), neutral=float("inf"), min=0.0),),
    command=command,
    order=20,
    odd=True,
    command_limit="limit",
    suggest_order=30,
    looks_like=("speed_limit_voltage",),
    trials=lambda s: alternatives("limit", [r * s.command_most for r in SHARES]),
    not_cancelled="no command brings back what the limit cuts off",
)
