"""A coupling that lets go above a torque."""

from math import isfinite
from typing import Any

from idloop.physics.effect import COUPLING, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def coupling(torque: float, twist: float, stiffness: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Torque relative to the slipped angle, at most the limit."""
    return min(max(torque - stiffness * state[0], -parameters[0]), parameters[0])


@hook
def settle(torque: float, twist: float, stiffness: float, elapsed: float, state: Any, parameters: Any) -> float:
    """The angle by which the limit was exceeded stays."""
    carried = torque - stiffness * state[0]
    if carried > parameters[0]:
        state[0] += (carried - parameters[0]) / stiffness
    elif carried < -parameters[0]:
        state[0] += (carried + parameters[0]) / stiffness
    return state[0]


EFFECT = Effect(
    name="slip",
    site=COUPLING,
    text="Above a torque the coupling slips and the two sides stay turned against each other.",
    also_called=("slipping", "clutch", "belt_slip"),
    equation=EffectEquation(
        "",
        r"@F_{@s} = k_{@s}\,(\Delta @q - s) + c_{@s}\,\Delta @v\text{, where } s \text{ moves only to keep } "
        r"\left|@F_{@s}\right| \le @F_{\max}",
        {"limit": r"@F_{\max}"},
    ),
    parameters=(EffectParameter("limit", "{force}", start=float("inf"), neutral=float("inf"), min=0.0),),
    coupling=coupling,
    settle=settle,
    # It begins and ends inside a step, which knows of the slipped angle only afterwards: short steps.
    rate=lambda values, inertia, stiffness: 3.0 * (stiffness / inertia) ** 0.5 if isfinite(values["limit"]) else 0.0,
    states=1,
    order=60,
    looks_like=("saturation",),
    trials=lambda s: alternatives("limit", [r * s.torque_most for r in (0.97, 0.85, 0.7, 0.5, 0.3)]),
    not_cancelled="what has slipped stays turned, whatever the drive does",
)
