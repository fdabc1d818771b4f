"""Friction that is a spring before gross motion: Dahl and LuGre bristle models.

Canudas de Wit, Olsson, Åström, Lischinsky, "A new model for control of systems with friction",
IEEE Trans. Automatic Control 40(3), 1995.
"""

import math
from typing import Any

from idloop.physics.effect import BODY, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import Scales, Trial


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """-(stiffness z + damping dz/dt); z follows in closed form while the speed is held."""
    level, stiffness = parameters[0], parameters[1]
    if level <= 0.0 or stiffness <= 0.0:
        return 0.0
    speed = abs(velocity)
    ratio = velocity / parameters[3]
    limit = (level + (parameters[2] - level) * math.exp(-ratio * ratio)) / stiffness
    bristle = state[0]
    end = limit if velocity > 0.0 else -limit
    if speed * elapsed > 1e-12 * limit:
        bristle = end + (bristle - end) * math.exp(-speed * elapsed / limit)
    rate = velocity - speed * bristle / limit
    return -(stiffness * bristle + parameters[4] * rate)


@hook
def settle(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Move the bristles to the end of the step, with the mean speed of the step."""
    level, stiffness = parameters[0], parameters[1]
    if level <= 0.0 or stiffness <= 0.0:
        state[1] = velocity
        return 0.0
    mean = 0.5 * (state[1] + velocity)
    ratio = mean / parameters[3]
    limit = (level + (parameters[2] - level) * math.exp(-ratio * ratio)) / stiffness
    end = limit if mean > 0.0 else -limit
    if abs(mean) * elapsed > 1e-12 * limit:
        state[0] = end + (state[0] - end) * math.exp(-abs(mean) * elapsed / limit)
    state[1] = velocity
    return state[0]


def _lugre(scales: Scales, dahl: Trial) -> list[list[Trial]]:
    """Bristles that are damped, and friction that falls with the speed, beside Dahl's level and stiffness."""
    level, stiffness = dahl["level"], dahl["stiffness"]
    critical = 2.0 * (stiffness * scales.inertia) ** 0.5
    return [
        [{**dahl, "static": share * level, "velocity": slow * scales.speed, "damping": damping * critical}]
        for share, slow in ((1.05, 0.1), (1.3, 0.02), (1.3, 0.1), (1.3, 0.4))
        for damping in (0.05, 0.5)
    ]


EFFECT = Effect(
    name="presliding_friction",
    site=BODY,
    text="Before gross motion the contact gives like a stiff spring, so friction builds up over a small displacement.",
    also_called=("dahl", "lugre", "bristle", "microslip"),
    equation=EffectEquation(
        r"-@F_{\text{p}@i}",
        r"@F_{\text{p}@i} = \sigma_0 z + \sigma_1 \dot{z},\quad \dot{z} = @v - \frac{\sigma_0\left|@v\right|}"
        r"{f_c + (f_s - f_c)\,e^{-(@v/v_s)^2}}\,z",
        {"level": "f_c", "stiffness": r"\sigma_0", "static": "f_s", "velocity": "v_s", "damping": r"\sigma_1"},
    ),
    parameters=(
        EffectParameter("level", "{force}", min=0.0),
        EffectParameter("stiffness", "{force}/{position}", start=1e3, min=0.0),
        EffectParameter("static", "{force}", min=0.0, optional="level"),
        EffectParameter("velocity", "{position}/s", start=0.1, min=1e-6, held=True),
        EffectParameter("damping", "{force}·s/{position}", min=0.0, held=True),
    ),
    force=force,
    settle=settle,
    states=2,
    rate=lambda values, inertia, stiffness: (
        (values["stiffness"] / inertia) ** 0.5 + values["damping"] / inertia if values["level"] > 0.0 else 0.0
    ),
    spatial_rate=lambda values, inertia, stiffness: values["stiffness"] / max(values["level"], 1e-12) * 0.5,
    relaxes=True,
    looks_like=("compliance", "backlash"),
    trials=lambda s: [
        [{"level": level, "stiffness": level / (reach * s.span)}]
        for reach in (0.0001, 0.0005, 0.002, 0.01, 0.05, 0.2)
        for level in ([s.dry] if s.dry else [0.05 * s.force, 0.2 * s.force])
    ],
    further=_lugre,
    contains={"coulomb_friction": {"level": "level"}},
    valid=lambda values: values.get("static", values["level"]) >= values["level"],
)
