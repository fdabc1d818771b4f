"""Band-limited force balance of a record, from which a force error is computed."""

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
class RecordBalance:
    """Motion and command of one record, on which a force balance is evaluated."""

    motion: Motion
    held: HeldCommand
    conditions: Conditions | None = None

    def command(self, shift: float) -> Array:
        """Mean command over one sample around each instant, delayed by ``shift`` [s]."""
        return self.held.around(self.motion.time - shift, self.motion.sample_time).mean


def record_balance(engine: Engine, data: Data, cutoff: float | None = None) -> RecordBalance | None:
    """Prepare the force balance of a record; None when some body is not measured.

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
    return RecordBalance(motion, HeldCommand(data.input_time, data.input, float(data.time[-1])), data.conditions)


def thin(values: Array, motion: Motion) -> Array:
    """Low-pass values (n, k) to the comparison band of a motion, without the filter's transients, and decimate them."""
    filtered = low_pass(values, motion.comparison_band, motion.sample_time)
    edge = min(int(np.ceil(2.0 / (motion.comparison_band * motion.sample_time))), len(values) // 10)
    factor = max(int(1.0 / (2.5 * motion.comparison_band * motion.sample_time)), 1)
    return np.ascontiguousarray(filtered[edge : len(values) - edge : factor])
