"""The DC motor whose parameters the grey-box section estimates: truth, start and data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from speed.plants import steps_of_command

if TYPE_CHECKING:
    from idloop.physics import Model

Array = NDArray[np.float64]

PERIOD = 1e-3
TRUTH = {"gain": 8.255, "viscous": 2.306, "coulomb": 1.0, "static": 1.6, "velocity": 0.2}
START = {"gain": 6.0, "viscous": 3.0, "coulomb": 0.6, "static": 1.1, "velocity": 0.3}
DEVIATIONS = (1e-3, 5e-3)  # of the noise of position [rad] and speed [rad/s]


def motor(values: dict[str, float], names: tuple[str, ...] = tuple(TRUTH)) -> Model:
    """DC motor preset with these values, all of them free; without Stribeck friction if none is named."""
    from idloop.physics import load_model

    model = load_model("dc_motor")
    if "coulomb" in names:
        friction = {name: {"value": values[name]} for name in ("coulomb", "static", "velocity")}
        model = model.with_effect("stribeck_friction", "motor", **friction)
    return model.with_values({"drive.gain": values["gain"], "motor.viscous_friction": values["viscous"]})


def experiment(seconds: float, names: tuple[str, ...] = tuple(TRUTH), seed: int = 1) -> dict[str, Array]:
    """Command, and position and speed with noise, at 1 kHz."""
    from idloop.physics import simulate

    command = steps_of_command(int(seconds / PERIOD), seed)
    stamps = np.arange(len(command)) * PERIOD
    clean = simulate(motor(TRUTH, names), stamps, command, stamps).output
    noise = np.random.default_rng(seed + 100).standard_normal(clean.shape) * DEVIATIONS
    return {"command": command, "output": clean + noise, "deviations": np.array(DEVIATIONS)}
