"""How large things are in a machine that hides nothing, under one excitation: what strengths are shares of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from by_equations import EquationsMachine
from case import Drive
from excitations import EXCITATIONS
from laws import law
from machines import MACHINES, base_model
from numpy.typing import NDArray
from plain import Plain, plain
from simulators import run

Array = NDArray[np.float64]

# The machine runs for so long [s].
DURATION = 12.0


@dataclass(frozen=True)
class Sizes:
    """Typical sizes, root mean square unless said otherwise.

    Attributes
    ----------
    command, command_peak : float
        Command [input unit].
    force : float
        Force of the drive.
    speed, speed_peak : float
        Of the first body.
    stroke : float
        Standard deviation of the first body's position.
    twist, torque_peak : tuple of float
        Twist of each coupling, and the largest torque through it.
    """

    command: float
    command_peak: float
    force: float
    speed: float
    speed_peak: float
    stroke: float
    twist: tuple[float, ...]
    torque_peak: tuple[float, ...]


class Watched(EquationsMachine):
    """A machine whose true motion is kept."""

    def __init__(self, plain: Plain, sample_time: float, samples: int) -> None:
        super().__init__(plain, sample_time, samples)
        self.position: list[Array] = []
        self.velocity: list[Array] = []

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance for one sample."""
        self.position.append(self._x.copy())
        self.velocity.append(self._v.copy())
        super().step(command, disturbance)


@cache
def sizes(machine: str, loop: str, drive: Drive, effects: tuple[str, ...] = ()) -> Sizes:
    """Run the linear machine, or one with effects that split its bodies, without noise and measure."""
    kind = MACHINES[machine]
    rate = kind.rates[0]
    model = base_model(machine, rate, loop).with_effects(effects)
    signal, speed = EXCITATIONS[drive.kind](kind, drive.level, rate, DURATION, 1)
    numbers = plain(model)
    built = Watched(numbers, 1.0 / rate, len(signal))
    quiet = np.zeros((len(signal), len(model.outputs)))
    behind = law("equations", model.controller, model.output_names)
    command, _ = run(built, signal, speed, quiet, np.zeros(len(signal)), behind)
    x, v = np.array(built.position), np.array(built.velocity)
    twist = x[:, :-1] - x[:, 1:]
    values = model.values
    return Sizes(
        command=float(np.sqrt(np.mean(command**2))),
        command_peak=float(np.max(np.abs(command))),
        force=float(values["drive.gain"] * np.sqrt(np.mean(command**2))),
        speed=float(np.sqrt(np.mean(v[:, 0] ** 2))),
        speed_peak=float(np.max(np.abs(v[:, 0]))),
        stroke=float(np.std(x[:, 0])),
        twist=tuple(np.sqrt(np.mean(twist**2, axis=0)).tolist()),
        torque_peak=tuple((np.array(numbers.stiffness) * np.max(np.abs(twist), axis=0)).tolist()),
    )
