"""Control loops inside a drive: a servo that receives a position or a velocity makes its own force.

The loop is the first equation of the input's chain: a set-point comes in, the output of the drive (a voltage, a
current, a duty cycle, a force) comes out, and the effects at the input act on that output. It is a continuous loop; its
sample time and its delay count to first order, as a motion measured late by the delay and half a sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from idloop.physics.effect import INPUT, Effect, EffectEquation, EffectParameter
from idloop.physics.hooks import hook

INF = float("inf")
# Fastest rate of a loop with memory, whose states are settled once in a step [rad/s].
_MEMORY_RATE = 200.0


@hook
def _position_output(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Output clip(Kp e + Ki ∫ e dt - Kd v, ±limit), e = r - q."""
    at = value
    most, change = parameters[6], parameters[7]
    if most < 1e300 or change < 1e300:
        at = position if state[3] == 0.0 else state[1]
        if change < 1e300:
            at += state[2] * elapsed
        else:
            at += min(max(value - at, -most * elapsed), most * elapsed)
    error = at - position + (parameters[5] + 0.5 * parameters[4]) * velocity
    if error > parameters[8]:
        error -= parameters[8]
    elif error < -parameters[8]:
        error += parameters[8]
    else:
        error = 0.0
    # The error of the whole step is that in its middle.
    integral = state[0] + (error + 0.5 * elapsed * velocity) * elapsed
    output = parameters[0] * error + parameters[1] * integral - parameters[2] * velocity
    limited: float = min(max(output, -parameters[3]), parameters[3])
    return limited


@hook
def _settle_position(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Integrate the error, not beyond the limit, and move the set-point along its profile."""
    at = value
    most, change = parameters[6], parameters[7]
    if most < 1e300 or change < 1e300:
        if state[3] == 0.0:
            state[1], state[2], state[3] = position, 0.0, 1.0
        left = value - state[1]
        if change < 1e300:
            wanted = (2.0 * change * abs(left)) ** 0.5
            wanted = min(wanted, most) if left > 0.0 else -min(wanted, most)
            faster = min(max(wanted - state[2], -change * elapsed), change * elapsed)
            if abs(left) <= change * elapsed * elapsed and abs(state[2]) <= 2.0 * change * elapsed:
                state[1], state[2] = value, 0.0
            else:
                state[1] += (state[2] + 0.5 * faster) * elapsed
                state[2] += faster
        else:
            state[1] += min(max(left, -most * elapsed), most * elapsed)
        at = state[1]
    error = at - position + (parameters[5] + 0.5 * parameters[4]) * velocity
    if error > parameters[8]:
        error -= parameters[8]
    elif error < -parameters[8]:
        error += parameters[8]
    else:
        error = 0.0
    integral = state[0] + (error + 0.5 * elapsed * velocity) * elapsed
    output = parameters[0] * error + parameters[1] * integral - parameters[2] * velocity
    # Conditional integration: nothing is added while the output is at its limit and the error drives it further.
    if abs(output) < parameters[3] or output * error < 0.0:
        state[0] = integral
    return 0.0


@hook
def _velocity_output(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Output clip(Kp e + Ki ∫ e dt + Kf r, ±limit), e = r - v."""
    at = value
    if parameters[4] < 1e300:
        at = velocity if state[2] == 0.0 else state[1]
        at += min(max(value - at, -parameters[4] * elapsed), parameters[4] * elapsed)
    # The integral of the velocity is the way.
    way = velocity * elapsed if state[2] == 0.0 else position - state[3]
    output = parameters[0] * (at - velocity) + parameters[1] * (state[0] + at * elapsed - way) + parameters[2] * at
    limited: float = min(max(output, -parameters[3]), parameters[3])
    return limited


@hook
def _settle_velocity(
    value: float, velocity: float, position: float, elapsed: float, state: Any, parameters: Any
) -> float:
    """Integrate the error, not beyond the limit, and move the set-point along its ramp."""
    at = value
    if parameters[4] < 1e300:
        at = velocity if state[2] == 0.0 else state[1]
        at += min(max(value - at, -parameters[4] * elapsed), parameters[4] * elapsed)
        state[1] = at
    way = velocity * elapsed if state[2] == 0.0 else position - state[3]
    error, integral = at - velocity, state[0] + at * elapsed - way
    output = parameters[0] * error + parameters[1] * integral + parameters[2] * at
    if abs(output) < parameters[3] or output * error < 0.0:
        state[0] = integral
    state[2], state[3] = 1.0, position
    return 0.0


def _rate(values: Mapping[str, float], inertia: float, stiffness: float) -> float:
    """Rate that the memory of a loop needs; that of its gains is in the motion's matrix."""
    profile = min(values.get("profile_velocity", INF), values.get("profile_acceleration", INF)) < INF
    return _MEMORY_RATE if profile or values["integral"] else 0.0


def _limits(*names: str, unit: str) -> tuple[EffectParameter, ...]:
    return tuple(EffectParameter(name, unit, start=INF, neutral=INF, min=0.0) for name in names)


POSITION_LOOP = Effect(
    name="position_loop",
    site=INPUT,
    text="The drive receives a position and makes its output by a PID controller of its own.",
    equation=EffectEquation(
        "u_d",
        r"u_d = K_p\,(@u - @q) + K_i \int (@u - @q)\,dt - K_d\,@v",
        {"proportional": "K_p", "integral": "K_i", "derivative": "K_d"},
    ),
    parameters=(
        EffectParameter("proportional", "{input}/{position}", min=0.0),
        EffectParameter("integral", "{input}/({position}·s)", min=0.0),
        EffectParameter("derivative", "{input}·s/{position}", min=0.0),
        *_limits("limit", unit="{input}"),
        EffectParameter("sample_time", "s", min=0.0, chosen=True),
        EffectParameter("delay", "s", min=0.0),
        *_limits("profile_velocity", unit="{position}/s"),
        *_limits("profile_acceleration", unit="{position}/s²"),
        EffectParameter("dead_band", "{position}", min=0.0),
    ),
    command=_position_output,
    settle=_settle_position,
    states=4,
    rate=_rate,
    order=0,
    not_cancelled="the loop of the drive acts on the set-point, and no force is commanded",
)

VELOCITY_LOOP = Effect(
    name="velocity_loop",
    site=INPUT,
    text="The drive receives a velocity and makes its output by a PI controller of its own.",
    equation=EffectEquation(
        "u_d",
        r"u_d = K_p\,(@u - @v) + K_i \int (@u - @v)\,dt + K_f\,@u",
        {"proportional": "K_p", "integral": "K_i", "feed_forward": "K_f"},
    ),
    parameters=(
        EffectParameter("proportional", "{input}·s/{position}", min=0.0),
        EffectParameter("integral", "{input}/{position}", min=0.0),
        EffectParameter("feed_forward", "{input}·s/{position}"),
        *_limits("limit", unit="{input}"),
        *_limits("profile_acceleration", unit="{position}/s²"),
    ),
    command=_velocity_output,
    settle=_settle_velocity,
    states=4,
    rate=_rate,
    order=0,
    not_cancelled="the loop of the drive acts on the set-point, and no force is commanded",
)


@dataclass(frozen=True)
class LoopGains:
    """Output of a loop to first order: of the set-point, of the position and of the velocity of body 0."""

    set_point: float
    position: float
    velocity: float


def loop_gains(kind: str, own: Mapping[str, float]) -> LoopGains:
    """Gains of a loop within its limits, without its integral.

    `kind`: one of "position_loop", "velocity_loop". `own`: values of its parameters.
    """
    gain = own["proportional"]
    if kind == VELOCITY_LOOP.name:
        return LoopGains(gain + own["feed_forward"], 0.0, -gain)
    late = own["delay"] + 0.5 * own["sample_time"]
    return LoopGains(gain, -gain, gain * late - own["derivative"])


@lru_cache
def loop_effect(kind: str, *, memory: bool) -> Effect:
    """The loop of a kind; one without an integral and without a profile has no memory."""
    effect = LOOPS[kind]
    return effect if memory else replace(effect, settle=None, states=0)


MEMORY = ("integral", "profile_velocity", "profile_acceleration")
LOOPS = {loop.name: loop for loop in (POSITION_LOOP, VELOCITY_LOOP)}
