"""Interface of a machine for the plant node and closed loops."""

from __future__ import annotations

from typing import Protocol

from idloop.arrays import Array
from idloop.physics.model import Model


class Machine(Protocol):
    """A machine that is stepped: commands in, measurements out; times in seconds from its start."""

    model: Model

    @property
    def time(self) -> float:
        """Time now."""

    def reset(self) -> None:
        """Return to the start."""

    def measure(self) -> Array:
        """Read the model's outputs now (p,)."""

    def schedule(self, stamp: float, command: float) -> None:
        """Apply a command from an instant on, or from now when that is past."""

    def advance(self, until: float) -> None:
        """Run to an instant."""

    def step(self, command: float, until: float) -> None:
        """Apply a command from now on and run to an instant."""
