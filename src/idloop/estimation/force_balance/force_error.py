"""The force balance of a model along a measured motion, band-limited: what a force error is read off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.force_balance.held_command import HeldCommand
from idloop.estimation.force_balance.motion import Motion, low_pass, measured_motion

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Engine
    from idloop.physics.conditions import Conditions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Balance:
    """What the force balance of one record is evaluated on."""

    motion: Motion
    held: HeldCommand
    conditions: Conditions | None = None

    def command(self, shift: float) -> Array:
        """Mean command over one sample around each instant, ``shift`` [s] earlier."""
        return self.held.around(self.motion.time - shift, self.motion.sample_time).mean


def balance_of(engine: Engine, data: Data, cutoff: float | None = None) -> Balance | None:
    """Prepare the force balance of a record, or None when some body is not measured.

    Parameters
    ----------
    engine : Engine
    data : Data
    cutoff : float, optional
        Cut-off of the differentiating filter [Hz]; from the data when left out.
    """
    motion = measured_motion(engine.model, data, cutoff)
    if motion is None or engine.layout(None).bodies != len(engine.model.bodies):
        return None
    return Balance(motion, HeldCommand(data.input_time, data.input, float(data.time[-1])), data.conditions)


def thin(values: Array, motion: Motion) -> Array:
    """Low-pass to the comparison band, drop the filter's edges, keep what carries information.

    Parameters
    ----------
    values : array, shape (n, k)
    motion : Motion
        Gives sample time and band.

    Returns
    -------
    array, shape (m, k)
    """
    filtered = low_pass(values, motion.comparison_band, motion.sample_time)
    edge = min(int(np.ceil(2.0 / (motion.comparison_band * motion.sample_time))), len(values) // 10)
    factor = max(int(1.0 / (2.5 * motion.comparison_band * motion.sample_time)), 1)
    return np.ascontiguousarray(filtered[edge : len(values) - edge : factor])
