"""How a rival is held against an experiment: by its observer's innovations, or by the balance of forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.estimation.optimisation.caching_engine import CachingEngine
    from idloop.records import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Difference:
    """Root mean square by which a rival misses something measurable, and the noise of that."""

    name: str
    value: float
    unit: str
    noise: float


class View(Protocol):
    """One rival's errors on the data so far and on experiments, on the scale that it shares with the others."""

    engine: CachingEngine

    @property
    def stronger(self) -> list[float]:
        """Decades by which the disturbance may be taken for stronger than it is."""

    @property
    def period(self) -> int:
        """Every so many-th instant everything is measured."""

    def seen(self, theta: Array) -> Array:
        """Errors on the data so far as one vector, white and of unit variance by this rival's own noise."""

    def innovations(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Errors on an experiment that began at rest at `start`, shape (n, p)."""

    def scaled(self, raw: Array, decades: float = 0.0) -> Array:
        """Series of such errors (n, p, k), white and of unit variance where the rival is right: (rows, k)."""

    def transferred(self, raw: Array, decades: float) -> Array:
        """The same errors, the disturbance taken for stronger."""

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance of the noise then, by group, in units of that of the right disturbance."""

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and outputs of each group in what `scaled` returns."""

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> list[Difference]:
        """What is missed, in units of the machine."""
