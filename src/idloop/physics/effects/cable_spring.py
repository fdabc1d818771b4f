"""A spring to the ground: cable, hose, spiral spring."""

from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-stiffness (position - rest)."""
    return -parameters[0] * (position - parameters[1])


# A joint that turns by a little more than once, behind a gear of 160:1: what turns further has no spring to wind up.
_MOST_TURNS = 200.0

EFFECT = Effect(
    name="cable_spring",
    site=BODY,
    text="A cable, hose or return spring pulls the body towards a rest position.",
    also_called=("spring", "return_spring", "cable", "hose"),
    equation=EffectEquation(r"-k_s\,(@q - r_0)", "", {"stiffness": "k_s", "rest": "r_0"}),
    parameters=(
        EffectParameter("stiffness", "{force}/{position}", min=0.0),
        EffectParameter("rest", "{position}"),
    ),
    force=force,
    proportional=True,
    slow=True,
    anywhere=True,
    linear=True,
    rate=lambda values, inertia, stiffness: (values["stiffness"] / inertia) ** 0.5,
    looks_like=("imbalance",),
    trials=lambda s: (
        [
            [
                {"stiffness": 0.1 * s.force / s.span, "rest": s.middle},
                {"stiffness": 0.1 * s.force / s.span, "rest": s.middle + s.span},
            ]
        ]
        if s.turns <= _MOST_TURNS
        else []
    ),
    degenerates_to=("input_offset", "load_torque"),
)
