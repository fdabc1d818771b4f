"""A force that repeats with any period: poles of a linear motor, pitch of a screw, teeth of a belt, a geared motor."""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import repetitions


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-amplitude sin(2 pi position / period + phase)."""
    return -parameters[0] * math.sin(2.0 * math.pi * position / parameters[1] + parameters[2])


EFFECT = Effect(
    name="periodic_force",
    site=BODY,
    text="A force repeats with any period: poles of a linear motor, pitch of a screw, teeth of a belt, a geared motor.",
    also_called=("cogging_force", "detent_force", "force_ripple", "pitch_error"),
    equation=EffectEquation(
        r"-a_\lambda\sin(2\pi\,@q/\lambda + \varphi_\lambda)",
        "",
        {"amplitude": r"a_\lambda", "period": r"\lambda", "phase": r"\varphi_\lambda"},
    ),
    parameters=(
        EffectParameter("amplitude", "{force}", min=0.0),
        EffectParameter("period", "{position}", start=1.0, neutral=1.0, min=1e-9),
        EffectParameter("phase", "rad", min=-7.0, max=7.0),
    ),
    force=force,
    proportional=True,
    rate=lambda values, inertia, stiffness: (values["amplitude"] * 2.0 * math.pi / values["period"] / inertia) ** 0.5,
    spatial_rate=lambda values, inertia, stiffness: 2.0 * math.pi / values["period"],
    looks_like=("cable_spring",),
    trials=lambda s: repetitions(0.05 * s.force, s.periods),
    # Along an angle, cogging has the whole parts of a turn; that of a motor behind a gear need not.
    any_period=True,
    several=True,
)
