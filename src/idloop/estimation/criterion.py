"""Interface of a criterion, a function from parameters to errors that a fit minimises; initial states as nuisance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from idloop.arrays import Array
from idloop.estimation.dataset import Data, initial_motion, travel

if TYPE_CHECKING:
    from idloop.physics import Engine


# errors[group][record] has shape (samples, outputs of the group) and no NaN.
Errors = list[list[Array]]


class Criterion(Protocol):
    """Errors of a model on its records, with its own nuisance parameters."""

    name: str
    # Whether the errors are whitened by an autoregression before they are weighted.
    whiten: bool

    def retune(self, theta: Array) -> None:
        """Update what depends weakly on the parameters, such as observer gains."""

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Values, lower bounds, upper bounds and typical sizes of the nuisance parameters."""

    def keep(self, nuisance: Array) -> None:
        """Set the nuisance parameters."""

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Errors at given parameters."""


class InitialStates:
    """Initial positions and velocities of all records as nuisance parameters, and what acts on the driven body then.

    `force_scale`: typical disturbance force. When left out, the disturbance is 0 and no parameter, and an integral in
    the drive is one: what it contributes to the drive's output at the start. Both are constant forces.
    """

    def __init__(self, engine: Engine, data: list[Data], force_scale: float | None = None) -> None:
        from idloop.physics.kernel import DISTURBANCE

        self.engine, model = engine, engine.model
        bodies = self.bodies = len(model.bodies)
        self._disturbance = DISTURBANCE
        self._integral = force_scale is None and model.integrates
        force = np.zeros(1 if self._integral or force_scale is not None else 0)
        loop = model.loop_gains(model.values)
        self.width = 2 * bodies + len(force)
        self.values = np.concatenate([np.concatenate([*initial_motion(model, d), force]) for d in data])
        sizes = []
        for d in data:
            span = travel(model, d)
            speed = max(10.0 * span / float(d.time[-1] - d.time[0]), 1e-9)
            size = abs(loop.set_point) * (span if loop.position else speed) if force_scale is None else force_scale
            scales = [np.full(bodies, span), np.full(bodies, speed), np.full(len(force), max(size, 1e-12))]
            sizes.append(np.concatenate(scales))
        self.scale = np.concatenate(sizes)

    def part(self, nuisance: Array, record: int) -> Array:
        """Nuisance parameters of one record."""
        return nuisance[record * self.width : (record + 1) * self.width]

    def state(self, nuisance: Array, record: int, theta: Array) -> Array:
        """Initial state of one record, for the simulator."""
        part, n = self.part(nuisance, record), self.bodies
        if self._integral:
            return self.engine.initial_state(part[:n], part[n : 2 * n], theta, part[2 * n])
        state = self.engine.initial_state(part[:n], part[n : 2 * n], theta)
        if self.width > 2 * n:
            state[self._disturbance] = part[2 * n]
        return state
