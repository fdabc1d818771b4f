"""A parameter of a model: known, or estimated within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

# Half-width of the 95 % interval of a normal variable, in standard deviations.
NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class Parameter:
    """A number of a model."""

    name: str  # path in the model, such as ``motor.inertia`` or ``dead_zone@input.width``
    value: float  # value in ``unit``
    # Bounds of the estimate
    min: float
    max: float
    free: bool  # estimated from data (a mapping in the model file) or known (a bare number)
    stderr: float | None  # standard error after a fit
    unit: str  # unit
    # Bounds as in the model file, to write them again; None where it has none
    stated: tuple[float | None, float | None] = (None, None)

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % confidence interval of the estimate; None where there is no standard error."""
        if not self.free or self.stderr is None or not math.isfinite(self.stderr):
            return None
        return self.value - NORMAL_95 * self.stderr, self.value + NORMAL_95 * self.stderr
