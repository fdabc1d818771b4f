"""Machines with a coefficient that is not constant, which no effect of the catalogue is, and such with constant ones.

One rotary body under random steps of torque, solved by the midpoint rule, with a slow disturbance torque and white
noise of the sensors; it shares no code with the models that are fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from idloop.records import Record

Array = NDArray[np.float64]

RATE = 200.0
INERTIA, FRICTION = 0.01, 0.05
NOISE = (5e-4, 1e-2)
_PUSH = 0.005
_STEPS = 10
# Acceleration at a time, torque, position and velocity.
Law = Callable[[float, float, float, float], float]


def uneven_inertia(_: float, torque: float, position: float, velocity: float, part: float) -> float:
    """Two bulges to the turn."""
    inertia = INERTIA * (1.0 + part * np.cos(2.0 * position))
    slope = -2.0 * part * INERTIA * np.sin(2.0 * position)
    return float((torque - FRICTION * velocity - 0.5 * slope * velocity**2) / inertia)


def warming(t: float, torque: float, _: float, velocity: float, part: float) -> float:
    """Grease that loses a part of its friction in half a minute."""
    return (torque - FRICTION * (1.0 - part * t / 30.0) * velocity) / INERTIA


def rippling_drive(_: float, torque: float, position: float, velocity: float, part: float) -> float:
    """A motor that is stronger at one side of the turn."""
    return float((torque * (1.0 + part * np.sin(position)) - FRICTION * velocity) / INERTIA)


def constant(_: float, torque: float, __: float, velocity: float, part: float = 0.0) -> float:
    """Nothing changes."""
    return (torque - FRICTION * velocity) / INERTIA


# What changes, and over what, as the diagnosis is to tell it.
CHANGING: dict[str, tuple[Callable[..., float], str, str]] = {
    "inertia over the turn": (uneven_inertia, "inertia", "axis.position within a turn"),
    "friction over time": (warming, "viscous friction", "time"),
    "drive over the turn": (rippling_drive, "drive", "axis.position within a turn"),
}


def changing(kind: str, part: float) -> Law:
    """Law of one kind of `CHANGING`, by how much of its coefficient changes."""
    return partial(CHANGING[kind][0], part=part)


def recorded(law: Law, seed: int, seconds: float = 15.0, coloured: float = 0.0) -> Record:
    """Record of a law, with coloured noise of so many times the white one's deviation before its filter."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE)
    command = rng.normal(size=int(4 * seconds) + 1)[(4 * time).astype(int)]
    push = rng.normal(size=len(time))
    noise = rng.normal(size=(len(time), 2)) * NOISE
    if coloured:
        drift = rng.normal(size=(len(time), 2)) * NOISE * coloured
        for k in range(1, len(drift)):
            drift[k] += 0.9 * drift[k - 1]
        noise += drift
    torque = position = velocity = 0.0
    rows, step = [], 1.0 / RATE / _STEPS
    for t, u, w in zip(time.tolist(), command.tolist(), push.tolist(), strict=True):
        rows.append((position, velocity))
        torque = 0.9 * torque + _PUSH * w
        for _ in range(_STEPS):
            half = velocity + 0.5 * step * law(t, u + torque, position, velocity)
            slope = law(t, u + torque, position + 0.5 * step * velocity, half)
            position, velocity = position + step * half, velocity + step * slope
    names, units = ("axis.position", "axis.velocity"), ("rad", "rad/s")
    return Record("changing", time, command, time, np.array(rows) + noise, "axis.effort", "N·m", names, units)
