"""The Lehigh motor solved piece by piece in closed form; nothing of idloop's physics takes part.

Between two samples the command is held and the sense of motion changes at most twice (to a stop, and away from it),
so that velocity and position are exponentials whose ends are known exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GearedMotor:
    """dv/dt = gain · dz(u) − damping · v − friction · sign(v), and a potentiometer behind a gap.

    Attributes
    ----------
    gain : float
        [rad/(s² V)]
    damping : float
        [1/s]
    dead_zone : float
        Half its width: the command that just does nothing [V].
    friction : float
        Deceleration by dry friction [rad/s²].
    gap : float
        Whole backlash between gearbox and potentiometer [rad].
    """

    gain: float
    damping: float
    dead_zone: float = 0.0
    friction: float = 0.0
    gap: float = 0.0

    def run(self, command: Array, sample_time: float) -> Array:
        """Run from rest in the middle of the gap.

        Parameters
        ----------
        command : ndarray, shape (n,)
            Held from each sample to the next [V].
        sample_time : float
            [s]

        Returns
        -------
        ndarray, shape (n, 2)
            Position behind the gap [rad] and velocity before it [rad/s] at the samples.
        """
        angle = speed = behind = 0.0
        found = np.empty((len(command), 2))
        for k, voltage in enumerate(command):
            found[k] = behind, speed
            push = self.gain * math.copysign(max(abs(voltage) - self.dead_zone, 0.0), voltage)
            left = sample_time
            while left > 0.0:
                used, angle, speed = self._piece(push, left, angle, speed)
                behind = min(max(behind, angle - 0.5 * self.gap), angle + 0.5 * self.gap)
                left -= used
        return found

    def _piece(self, push: float, left: float, angle: float, speed: float) -> tuple[float, float, float]:
        """Move on to the next stop, or through all that is left of the sample: time used, angle and speed after it."""
        if speed == 0.0 and abs(push) <= self.friction:
            return left, angle, 0.0
        sense = math.copysign(1.0, speed if speed != 0.0 else push)
        final = (push - sense * self.friction) / self.damping
        stops = speed * final < 0.0
        until = math.log1p(-speed / final) / self.damping if stops else math.inf
        used = min(left, until)
        decay = -math.expm1(-self.damping * used)
        after = 0.0 if until <= left else speed + (final - speed) * decay
        return used, angle + final * used + (speed - final) * decay / self.damping, after
