"""What a criterion is: a rule that turns parameters into errors to be made small."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.dataset import Data, first_motion, travel

if TYPE_CHECKING:
    from idloop.physics import Engine

Array = NDArray[np.float64]

# errors[group][record] has shape (samples, outputs of the group) and no NaN.
Errors = list[list[Array]]


class Criterion(Protocol):
    """Errors of a model on its records, with nuisance parameters of its own."""

    name: str
    # Whether the errors are whitened by an autoregression before they are weighed.
    whiten: bool

    def retune(self, theta: Array) -> None:
        """Adapt whatever depends on the parameters only slowly (gains, noise ratio)."""

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Start, lower bound, upper bound and typical size of the nuisance parameters."""

    def keep(self, nuisance: Array) -> None:
        """Take over nuisance parameters that a search found."""

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Errors at given parameters."""


class InitialStates:
    """Initial positions, velocities and disturbance force of every record as nuisance parameters.

    Parameters
    ----------
    engine : Engine
    data : list of Data
    force_scale : float, optional
        Typical disturbance force; without one the disturbance is 0 and no parameter.
    """

    def __init__(self, engine: Engine, data: list[Data], force_scale: float | None = None) -> None:
        from idloop.physics.kernel import DISTURBANCE

        self.engine, model = engine, engine.model
        bodies = self.bodies = len(model.bodies)
        self._disturbance = DISTURBANCE
        force = np.zeros(0) if force_scale is None else np.zeros(1)
        self.width = 2 * bodies + len(force)
        self.values = np.concatenate([np.concatenate([*first_motion(model, d), force]) for d in data])
        sizes = []
        for d in data:
            span = travel(model, d)
            speed = max(10.0 * span / float(d.time[-1] - d.time[0]), 1e-9)
            scales = [np.full(bodies, span), np.full(bodies, speed), np.full(len(force), force_scale or 0.0)]
            sizes.append(np.concatenate(scales))
        self.scale = np.concatenate(sizes)

    def part(self, nuisance: Array, record: int) -> Array:
        """Nuisance parameters of one record."""
        return nuisance[record * self.width : (record + 1) * self.width]

    def state(self, nuisance: Array, record: int, theta: Array) -> Array:
        """State at the start of one record, for the simulator."""
        part, n = self.part(nuisance, record), self.bodies
        state = self.engine.initial_state(part[:n], part[n : 2 * n], theta)
        if self.width > 2 * n:
            state[self._disturbance] = part[2 * n]
        return state
