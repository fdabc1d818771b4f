"""A coupling that stiffens as it twists."""

from typing import Any

from idloop.physics.effect import COUPLING, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import alternatives


@hook
def coupling(torque: float, twist: float, stiffness: float, elapsed: float, state: Any, parameters: Any) -> float:
    """K twist + k3 twist^3."""
    return torque + parameters[0] * twist * twist * twist


EFFECT = Effect(
    name="hardening_stiffness",
    site=COUPLING,
    text="The coupling grows stiffer the more it is twisted.",
    also_called=("nonlinear_stiffness", "cubic_stiffness", "duffing"),
    equation=EffectEquation(r"+k_3\,(\Delta @q)^3", "", {"cubic": "k_3"}),
    parameters=(EffectParameter("cubic", "{force}/{position}³"),),
    coupling=coupling,
    order=40,
    looks_like=("compliance",),
    trials=lambda s: alternatives("cubic", [r * s.stiffness / s.twist**2 for r in (0.001, 0.01, 0.1)]),
    not_cancelled="it acts between the bodies, where there is no drive",
)
