"""What a remaining structure is learnt as: a curve over one variable, by its heights at knots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A curve that the errors may follow.

    Attributes
    ----------
    over, unit : str
        Variable that it is a curve over, and its unit.
    of, of_unit : str
        What the curve gives: a force, a command, or a coefficient such as the inertia, and its unit.
    knots : array, shape (k,)
    step : float
        Height of a trial curve.
    change : callable
        Change of the whitened errors by heights at the knots, shape (k,), or (k - 1,) where the last knot is the first
        again; None where they cannot be simulated.
    closed : bool
    repeats : bool
        The knots span a period that the data have shown, not one that is known, such as a turn.
    coefficient : bool
        The curve is one of a coefficient, of which only the change along it counts.
    tried : int
        Shapes that this one was chosen from.
    """

    over: str
    unit: str
    of: str
    of_unit: str
    knots: Array
    step: float
    change: Callable[[Array], Array | None]
    closed: bool = False
    repeats: bool = False
    coefficient: bool = False
    tried: int = 1

    @property
    def variable(self) -> str:
        """The variable without its body."""
        return self.over.partition(".")[2] or self.over

    @property
    def text(self) -> str:
        """In words, such as "a force over the velocity"."""
        return f"{'the' if self.coefficient else 'a'} {self.of} over the {self.variable}"

    @property
    def heights(self) -> int:
        """Number of heights to be learnt."""
        return len(self.knots) - int(self.closed)

    def hats(self) -> list[Array]:
        """Trial curves: one hat on every knot, shape (heights,) each."""
        return list(self.step * np.eye(self.heights))
