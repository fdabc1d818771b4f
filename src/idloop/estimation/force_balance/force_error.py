"""Band-limited force balance of a record, from which a force error is computed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.estimation.force_balance.balance_terms import halfway
from idloop.estimation.force_balance.held_command import CommandAround, HeldCommand
from idloop.estimation.force_balance.motion import Motion, low_pass, measured_motion

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Engine
    from idloop.physics.conditions import Conditions


@dataclass(frozen=True)
class RecordBalance:
    """Motion and command of one record, on which a force balance is evaluated."""

    motion: Motion
    held: HeldCommand
    conditions: Conditions | None = None

    @cached_property
    def command(self) -> CommandAround:
        """The command over one sample around each instant."""
        return self.held.around(self.motion.time, self.motion.sample_time)

    def forces(self, engine: Engine, rest_speed: float) -> tuple[Array, Array]:
        """Force that a model's drive applies and force that the measured motion needs, shape (n,) each.

        A nonlinear effect at the command acts on the values on both sides of a jump, not on their mean: the balance is
        evaluated on either side and weighted by the time before and after the jump.

        `rest_speed`: speed below which the driven body counts as standing, in its own unit.
        """
        motion, around = self.motion, self.command
        value, weight = np.column_stack([around.mean, around.mean]), np.full((len(motion.time), 2), 0.5)
        value[around.jumps] = np.column_stack([around.before, around.after])
        weight[around.jumps] = np.column_stack([1.0 - around.late, around.late])
        time = (motion.time[:, None] + 0.25 * motion.sample_time * np.array([-1.0, 1.0])).ravel()
        position, velocity, acceleration = (
            np.repeat(one, 2, axis=0) for one in (motion.position, motion.velocity, motion.acceleration)
        )

        def along(rest: float) -> tuple[Array, Array]:
            found = engine.balance(
                None, position, velocity, acceleration, halfway(time), value.ravel(), time, rest,
                conditions=self.conditions,
            )  # fmt: skip
            applied, required = (np.sum(weight * one.reshape(-1, 2), axis=1) for one in (found.applied, found.required))
            return applied, required

        if not engine.model.integrates:
            return along(rest_speed)
        # What an integral adds from its start on is not measured, and holds a body at rest as well.
        applied, required = along(-1.0)
        moving = np.abs(motion.velocity[:, 0]) > rest_speed
        started = float(np.mean((required - applied)[moving if np.any(moving) else slice(None)]))
        acceleration[:, 0] -= started / engine.values(None)[f"{engine.model.bodies[0]}.inertia"]
        applied, required = along(rest_speed)
        return applied + started, required + started


def record_balance(engine: Engine, data: Data, cutoff: float | None = None) -> RecordBalance | None:
    """Prepare the force balance of a record; None when some body is not measured.

    `cutoff`: cut-off of the differentiating filter [Hz]; from the data when left out.
    """
    motion = measured_motion(engine.model, data, cutoff)
    if motion is None or engine.layout(None).bodies != len(engine.model.bodies):
        return None
    return RecordBalance(motion, HeldCommand(data.input_time, data.input), data.conditions)


def thin(values: Array, motion: Motion) -> Array:
    """Low-pass values (n, k) to the comparison band of a motion, without the filter's transients, and decimate them."""
    filtered = low_pass(values, motion.comparison_band, motion.sample_time)
    edge = min(int(np.ceil(2.0 / (motion.comparison_band * motion.sample_time))), len(values) // 10)
    factor = max(int(1.0 / (2.5 * motion.comparison_band * motion.sample_time)), 1)
    return np.ascontiguousarray(filtered[edge : len(values) - edge : factor])
