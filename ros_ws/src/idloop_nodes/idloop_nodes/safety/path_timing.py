"""The pace of a motion along its path: it starts softly, goes on for a while, and always ends at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AT_REST = 1e-6  # a smaller pace is none: what is left of rounding


@dataclass(frozen=True)
class PathTiming:
    """How far a motion is on its path after an instant.

    The pace is the path time that passes in a second: 0 at rest, 1 as planned. It grows to 1 at the rate 1 / `ramp`,
    and after `go` seconds falls to 0 at the same rate, so that whoever receives nothing more comes to rest on the path.

    Attributes
    ----------
    place : float
        Path time at the instant [s].
    pace : float
        At the instant, in [0, 1].
    go : float
        Time for which the motion goes on [s]; 0: it slows down at once.
    ramp : float
        Time from rest to the full pace and back [s].
    """

    place: float
    pace: float
    go: float
    ramp: float

    @property
    def until_rest(self) -> float:
        """Time until the motion rests [s]."""
        return self.go + self.ramp * min(1.0, self.pace + self.go / self.ramp)

    def after(self, elapsed: Array) -> tuple[Array, Array]:
        """Path times [s] and paces at times after the instant [s]; an array of shape (n,) each."""
        going = np.clip(elapsed, 0.0, self.go)
        speeding = np.minimum(going, (1.0 - self.pace) * self.ramp)
        fastest = self.pace + speeding / self.ramp
        place = self.place + speeding * 0.5 * (self.pace + fastest) + (going - speeding) * fastest
        slowing = np.clip(elapsed - self.go, 0.0, fastest * self.ramp)
        pace = fastest - slowing / self.ramp
        return place + slowing * 0.5 * (fastest + pace), np.where(pace > AT_REST, pace, 0.0)

    def at(self, elapsed: float) -> tuple[float, float]:
        """Path time [s] and pace at one time after the instant [s]."""
        place, pace = self.after(np.array([elapsed]))
        return float(place[0]), float(pace[0])
