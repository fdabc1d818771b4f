"""Gain that differs between positive and negative commands."""

from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = u (1 + ratio sign u)."""
    return value + parameters[0] * abs(value)


@hook
def undo(value: float, velocity: float, side: float, elapsed: float, state: Any, parameters: Any) -> float:
    """U = v / (1 + ratio sign v)."""
    return value / (1.0 + parameters[0]) if value > 0.0 else value / (1.0 - parameters[0])


EFFECT = Effect(
    name="gain_asymmetry",
    site=INPUT,
    text="The drive pushes harder in one direction than in the other for the same size of command.",
    also_called=("asymmetric_gain",),
    equation=EffectEquation("u_g", r"u_g = @u + \rho_u\left|@u\right|", {"ratio": r"\rho_u"}),
    parameters=(EffectParameter("ratio", "-", min=-0.95, max=0.95),),
    command=command,
    undo=undo,
    order=30,
    everyday=True,
    suggest_order=70,
    looks_like=("asymmetric_friction",),
    trials=lambda s: alternatives("ratio", [0.05]),
)
