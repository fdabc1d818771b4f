"""Supply voltage that back-EMF uses up at speed."""

from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import Scales, Trial


@hook
def command(value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Current v such that abs(v R + Ke w) <= supply."""
    supply, back_emf, resistance = parameters[0], parameters[1], parameters[2]
    high = (supply - back_emf * velocity) / resistance
    low = (-supply - back_emf * velocity) / resistance
    return min(max(value, low), high)


def _trials(s: Scales) -> list[list[Trial]]:
    if s.limit < float("inf"):  # what is cut at a usual speed stays
        backs = [share * s.limit / s.speed for share in (0.1, 0.4, 1.0)]
        return [[{"supply": s.limit + back * s.speed, "back_emf": back}] for back in backs]
    return [
        [{"supply": supply * s.command_most, "back_emf": back * s.command_most / s.speed_most}]
        for supply in (0.7, 1.0, 1.4)
        for back in (0.3, 0.7, 1.2)
    ]


EFFECT = Effect(
    name="speed_limit_voltage",
    site=INPUT,
    text="At speed the back-EMF leaves too little supply voltage for the commanded current, so the torque is cut.",
    also_called=("back_emf", "voltage_limit", "field_weakening"),
    equation=EffectEquation(
        "u_v",
        r"u_v = \min\left(\max\left(@u, \frac{-U - k_e\,@v}{R}\right), \frac{U - k_e\,@v}{R}\right)",
        {"supply": "U", "back_emf": "k_e", "resistance": "R"},
    ),
    parameters=(
        EffectParameter("supply", "V", start=float("inf"), neutral=float("inf"), min=0.0),
        EffectParameter("back_emf", "V/({position}/s)", min=0.0),
        EffectParameter("resistance", "Ω", start=1.0, min=1e-6, held=True),
    ),
    command=command,
    order=70,
    looks_like=("saturation",),
    trials=_trials,
    contains={"saturation": {"limit": "supply"}},
    not_cancelled="no command brings back what the supply cuts off",
)
