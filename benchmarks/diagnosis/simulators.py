"""The three simulators behind one interface, and the loop that runs a controller around them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from plain import plain

Array = NDArray[np.float64]
# From reference position, reference velocity and measurements to a command.
Law = Callable[[float, float, Array], float]

SIMULATORS = ("idloop", "mujoco", "equations")


class Machine(Protocol):
    """A machine that is stepped sample by sample; a measurement comes before the command of its stamp."""

    def measure(self, noise: Array) -> Array:
        """Read the sensors now."""

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance for one sample."""


def machine(simulator: str, model: Any, sample_time: float, samples: int) -> Machine:
    """Build a machine.

    Parameters
    ----------
    simulator : str
        One of `SIMULATORS`.
    model : idloop.physics.Model
        Its numbers; the foreign simulators read nothing else of idloop.
    sample_time : float
    samples : int
    """
    if simulator == "mujoco":
        from by_mujoco import MujocoMachine

        return MujocoMachine(plain(model), sample_time, samples)
    if simulator == "equations":
        from by_equations import EquationsMachine

        return EquationsMachine(plain(model), sample_time, samples)
    from by_idloop import IdloopMachine

    return IdloopMachine(model, sample_time, samples)


def run(
    built: Machine, signal: Array, rate: Array | None, noise: Array, disturbance: Array, law: Law | None
) -> tuple[Array, Array]:
    """Run a machine in open loop, or behind a controller.

    Parameters
    ----------
    built : Machine
    signal : ndarray (n,)
        Command, or with a controller the reference.
    rate : ndarray (n,) or None
        Velocity of the reference; 0 when it has none.
    noise : ndarray (n, p)
    disturbance : ndarray (n,)
        Torque on the first body, held over each sample.
    law : callable or None

    Returns
    -------
    command : ndarray (n,)
    output : ndarray (n, p)
    """
    command, output = np.empty(len(signal)), np.empty(noise.shape)
    for k, value in enumerate(signal):
        output[k] = built.measure(noise[k])
        speed = 0.0 if rate is None else float(rate[k])
        command[k] = value if law is None else law(float(value), speed, output[k])
        built.step(float(command[k]), float(disturbance[k]))
    return command, output
