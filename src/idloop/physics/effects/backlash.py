"""Lost motion: a gap between two bodies, or a play before the sensor."""

from typing import Any

from idloop.physics.effect import COUPLING, OUTPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.trial import Scales, Trial, alternatives


@hook
def coupling(torque: float, twist: float, stiffness: float, elapsed: float, state: Any, parameters: Any) -> float:
    """No torque inside the gap, K (twist -+ gap/2) outside."""
    half = 0.5 * parameters[0]
    if twist >= half:
        return torque - stiffness * half
    if twist <= -half:
        return torque + stiffness * half
    return 0.0


@hook
def edge(torque: float, twist: float, stiffness: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Where the sides touch: there the damping acts at once."""
    return 0.5 * parameters[0]


@hook
def reading(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Play operator: the reading is dragged along by the walls of the gap."""
    if state[1] == 0.0:
        return value
    half = 0.5 * parameters[0]
    return min(max(state[0], value - half), value + half)


@hook
def settle(value: float, position: float, velocity: float, elapsed: float, state: Any, parameters: Any) -> float:
    """Keep where the walls have dragged the reading; at the start it lies in the middle."""
    half = 0.5 * parameters[0]
    if state[1] == 0.0:
        state[0] = value
        state[1] = 1.0
    state[0] = min(max(state[0], value - half), value + half)
    return state[0]


GAP = EffectParameter("gap", "{position}", min=0.0)


def gaps(scales: Scales) -> list[list[Trial]]:
    """From a tenth of the coupling's twist on; of a stiff coupling that is far below any gap that machines have."""
    beside_twist = [r * scales.twist for r in (0.1, 0.3, 1.0, 3.0, 10.0)]
    # Close together: what touches at the wrong instants looks no better than what never touches.
    wider = [1.4**k * beside_twist[-1] for k in range(1, 9)]
    return alternatives("gap", beside_twist + [gap for gap in wider if gap < 0.02 * scales.span])


EFFECT = (
    Effect(
        name="backlash",
        site=COUPLING,
        text="There is a gap between the two sides: no torque passes until it is crossed.",
        also_called=("play", "lash", "lost_motion", "gear_play", "hysteresis"),
        equation=EffectEquation(
            "",
            r"@F_{@s} = 0 \text{ while } \left|\Delta @q\right| \le \tfrac{1}{2}\delta\text{, else } "
            r"k_{@s}\left(\Delta @q - \tfrac{1}{2}\delta\operatorname{sign}\Delta @q\right) + c_{@s}\,\Delta @v",
            {"gap": r"\delta"},
        ),
        parameters=(GAP,),
        lost_motion="gap",
        suggest_order=50,
        coupling=coupling,
        edge=edge,
        states=1,
        order=20,
        looks_like=("compliance", "stribeck_friction"),
        trials=gaps,
    ),
    Effect(
        name="backlash",
        site=OUTPUT,
        text="The measured side is held by friction inside a gap, so it lags by the gap at every reversal.",
        also_called=("play", "lash", "lost_motion", "gear_play", "hysteresis"),
        equation=EffectEquation(
            "y_p",
            r"y_p \leftarrow \min\left(\max\left(y_p, @y - \tfrac{1}{2}\delta\right), @y + \tfrac{1}{2}\delta\right)",
            {"gap": r"\delta"},
        ),
        parameters=(GAP,),
        lost_motion="gap",
        suggest_order=50,
        reading=reading,
        settle=settle,
        states=2,
        order=10,
        outputs=("position",),
        trials=lambda s: alternatives("gap", [r * s.span for r in (0.0005, 0.002, 0.008, 0.03, 0.1)]),
    ),
)
