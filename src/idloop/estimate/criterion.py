"""What a criterion is: a rule that turns parameters into errors to be made small."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.dataset import Data, first_motion, travel

if TYPE_CHECKING:
    from idloop.physics import Model

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
    """Initial position and velocity of every record as nuisance parameters.

    Parameters
    ----------
    model : Model
    data : list of Data
    """

    def __init__(self, model: Model, data: list[Data]) -> None:
        bodies = len(model.bodies)
        self.width = 2 * bodies
        self.values = np.concatenate([np.concatenate(first_motion(model, d)) for d in data])
        sizes = []
        for d in data:
            span = travel(model, d)
            speed = max(10.0 * span / float(d.time[-1] - d.time[0]), 1e-9)
            sizes.append(np.concatenate([np.full(bodies, span), np.full(bodies, speed)]))
        self.scale = np.concatenate(sizes)

    def of(self, nuisance: Array, record: int) -> tuple[Array, Array]:
        """Position and velocity at the start of one record."""
        part = nuisance[record * self.width : (record + 1) * self.width]
        return part[: self.width // 2], part[self.width // 2 :]
