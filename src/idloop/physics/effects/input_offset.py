"""Constant added to the command: amplifier or converter offset."""

from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """V = u + offset."""
    return value + parameters[0]


@hook
def undo(value: float, velocity: float, side: float, elapsed: float, state: Any, parameters: Any) -> float:
    """U = v - offset."""
    return value - parameters[0]


EFFECT = Effect(
    name="input_offset",
    site=INPUT,
    text="The drive acts as if a constant were added to every command: an offset of the amplifier or converter.",
    also_called=("bias", "offset"),
    equation=EffectEquation("u_o", "u_o = @u + o_u", {"offset": "o_u"}),
    parameters=(EffectParameter("offset", "{input}"),),
    command=command,
    undo=undo,
    order=40,
    same_as=("load_torque",),  # gain (u + offset) = gain u + constant
    by_hand={
        "load_torque": "with the load off and the command at zero, an amplifier's offset still turns the motor, "
        "a load does not",
    },
    suggest_order=40,
    looks_like=("load_torque", "imbalance", "asymmetric_friction"),
    slow=True,
    trials=lambda s: alternatives("offset", [0.05 * s.command]),
)
