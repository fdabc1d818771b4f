"""A servo axis whose friction, or drive, depends on a measured condition: integrated without idloop."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.physics.conditions import Condition
from idloop.records import Record

Array = NDArray[np.float64]

RATE = 200.0
INERTIA, VISCOUS, DRY = 0.01, 0.05, 0.12
POSITION_NOISE, VELOCITY_NOISE = 0.0005, 0.01


@dataclass(frozen=True)
class Machine:
    """One rotary body with friction.

    Attributes
    ----------
    viscous_slope, dry_slope : float
        Change of viscous [N·m·s/rad/K] and dry [N·m/K] friction from that at 20 °C.
    share : float
        Power of the supply over 24 V that the drive goes with.
    dry : float
        Dry friction at 20 °C [N·m].
    """

    viscous_slope: float = 0.0
    dry_slope: float = 0.0
    share: float = 0.0
    dry: float = DRY


def warming(seconds: float) -> Array:
    """A temperature that rises from 20 to 60 °C, as bodies warm."""
    time = np.arange(0.0, seconds, 0.5)
    return 20.0 + 40.0 * (1.0 - np.exp(-3.0 * time / seconds)) / (1.0 - np.exp(-3.0))


def sagging(seconds: float, command: Array, rng: np.random.Generator) -> Array:
    """A battery that empties from 26 to 20 V and gives way while much is asked of it."""
    time = np.arange(0.0, seconds, 0.02)
    drawn = np.abs(command[np.minimum((time * RATE).astype(int), len(command) - 1)])
    slow = np.convolve(drawn, np.ones(20) / 20.0)[: len(time)]
    return 26.0 - 5.0 * time / seconds - 0.5 * slow + 0.02 * rng.normal(size=len(time))


def run(machine: Machine, command: Array, temperature: Array, supply: Array) -> Array:
    """Position and velocity at every sample, from rest (n, 2): the solution of each stretch in closed form."""
    place = speed = 0.0
    motion = np.empty((len(command), 2))
    for k, u in enumerate(command):
        motion[k] = place, speed
        pole = (VISCOUS + machine.viscous_slope * (temperature[k] - 20.0)) / INERTIA
        dry = max(machine.dry + machine.dry_slope * (temperature[k] - 20.0), 0.0)
        drive, left = u * (supply[k] / 24.0) ** machine.share, 1.0 / RATE
        while left > 0.0:
            direction = np.sign(speed) if speed != 0.0 else np.sign(drive)
            if speed == 0.0 and abs(drive) <= dry:
                break
            final = (drive - direction * dry) / (pole * INERTIA)
            # It stops where final + (speed - final) exp(-pole t) = 0.
            stops = speed != 0.0 and final * direction < 0.0
            step = min(left, math.log((final - speed) / final) / pole) if stops else left
            keep = math.exp(-pole * step)
            place += final * step + (speed - final) * (1.0 - keep) / pole
            speed = 0.0 if step < left else final + (speed - final) * keep
            left -= step
    return motion


def record_of(
    machine: Machine, seed: int, seconds: float = 40.0, *, of: tuple[str, ...] = ("temperature",), name: str = "run"
) -> Record:
    """Record under random steps of many sizes, with the conditions named beside it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE)
    command = 0.8 * rng.normal(size=int(4 * seconds) + 1)[(4 * time).astype(int)]
    warm, volts = warming(seconds), sagging(seconds, command, rng)
    conditions = {
        "temperature": Condition("temperature", "°C", np.arange(len(warm)) * 0.5, warm),
        "supply": Condition("supply", "V", np.arange(len(volts)) * 0.02, volts),
    }
    along = {key: one.at(time + 0.5 / RATE) for key, one in conditions.items()}
    output = run(machine, command, along["temperature"], along["supply"])
    output += rng.normal(size=output.shape) * (POSITION_NOISE, VELOCITY_NOISE)
    return Record(
        name, time, command, time, output, "axis.effort", "N·m", ("axis.position", "axis.velocity"), ("rad", "rad/s"),
        conditions=tuple(conditions[key] for key in of),
    )  # fmt: skip
