"""Force criterion: inverse dynamics regression in the band that the excitation fills.

The force balance is evaluated along the measured, band-limited motion; what the
model leaves unexplained is the error (IDIM: Gautier, Janot and Vandanjon, 2013).
With a recorded reference or excitation the estimate is made consistent by
instruments: the part of the motion that the reference explains carries neither
measurement noise nor the disturbance (Janot, Vandanjon and Gautier, IEEE Trans.
Control Systems Technology 22, 2014; here without a model of the controller).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimate.criterion import Errors
from idloop.estimate.dataset import Data
from idloop.estimate.motion import Motion, low_pass, measured_motion
from idloop.estimate.reference import explained_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from idloop.physics import Engine
    from idloop.records import Record

Array = NDArray[np.float64]

# Effects that shift the command in time already; a free timing beside them would be the same thing twice.
_TIMING_EFFECTS = ("input_delay", "actuator_lag", "sensor_delay", "velocity_filter")


@dataclass(frozen=True)
class Balance:
    """What the force balance of one record is evaluated on."""

    motion: Motion
    # Integral of the held command, from which its mean over any window follows exactly.
    edges: Array
    area: Array
    # Motion and command that the reference or excitation explains; None without one.
    explained: tuple[Array, Array, Array, Array] | None
    explained_share: float

    def command(self, shift: float) -> Array:
        """Mean command over one sample around each instant, ``shift`` [s] earlier."""
        half = 0.5 * self.motion.sample_time
        at = self.motion.time - shift
        upper, lower = np.interp([at + half, at - half], self.edges, self.area)
        return np.asarray((upper - lower) / (2.0 * half))


def balance_of(engine: Engine, data: Data, record: Record | None, cutoff: float | None = None) -> Balance | None:
    """Prepare the force balance of a record, or None when some body is not measured.

    Parameters
    ----------
    engine : Engine
    data : Data
    record : Record or None
        Where the reference and the excitation are read from.
    cutoff : float, optional
        Cut-off of the differentiating filter [Hz]; from the data when left out.

    Returns
    -------
    Balance or None
    """
    motion = measured_motion(engine.model, data, cutoff)
    if motion is None or engine.layout(None).bodies != len(engine.model.bodies):
        return None
    edges = np.concatenate([data.input_time, [max(data.time[-1], data.input_time[-1]) + 10.0]])
    area = np.concatenate([[0.0], np.cumsum(data.input * np.diff(edges))])
    # Before the first command the command is 0.
    edges, area = np.concatenate([[edges[0] - 1e3], edges]), np.concatenate([[0.0], area])
    plain = Balance(motion, edges, area, None, 0.0)
    if record is None:
        return plain
    found = explained_motion(record, motion, plain.command(0.0))
    if found is None:
        return plain
    return Balance(motion, edges, area, found[0], found[1])


class ForceCriterion:
    """Unexplained force along the measured motion, low-passed and thinned out.

    Parameters
    ----------
    engine : Engine
        Compiled model.
    balances : list of Balance
        One per record.
    """

    name = "force"
    whiten = False

    def __init__(self, engine: Engine, balances: Sequence[Balance]) -> None:
        self.engine, self.balances = engine, list(balances)
        kinds = {active.effect.name for active in engine.model.effects}
        self.free_timing = not kinds.intersection(_TIMING_EFFECTS)
        self.shift = 0.0
        self.sample_time = float(np.median([b.motion.sample_time for b in self.balances]))

    @property
    def has_instruments(self) -> bool:
        """Whether every record's motion is explained by a recorded reference or excitation."""
        return all(b.explained is not None for b in self.balances)

    def retune(self, theta: Array) -> None:
        """Nothing depends on the parameters here."""

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Time from the stamp of a command to its action, unless the model has that itself."""
        if not self.free_timing:
            empty = np.zeros(0)
            return empty, empty, empty, empty
        step = self.sample_time
        return np.array([self.shift]), np.array([-step]), np.array([2.0 * step]), np.array([step])

    def keep(self, nuisance: Array) -> None:
        """Take over the timing."""
        if len(nuisance):
            self.shift = float(nuisance[0])

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Unexplained force by record, one column per body."""
        shift = float(nuisance[0]) if len(nuisance) else 0.0
        rows = []
        for b in self.balances:
            m = b.motion
            rows.append(self._left(theta, m, m.position, m.velocity, m.acceleration, b.command(shift)))
        return [rows]

    def explained_errors(self, theta: Array, nuisance: Array) -> Errors:
        """Unexplained force along the motion that the reference explains; its slopes are instruments."""
        shift = float(nuisance[0]) if len(nuisance) else 0.0
        rows = []
        for b in self.balances:
            if b.explained is None:
                raise IdloopError("a record has no reference that could serve as instrument")
            position, velocity, acceleration, command = b.explained
            moved = np.interp(b.motion.time - shift, b.motion.time, command)
            rows.append(self._left(theta, b.motion, position, velocity, acceleration, moved))
        return [rows]

    def _left(
        self, theta: Array, m: Motion, position: Array, velocity: Array, acceleration: Array, command: Array
    ) -> Array:
        error = self.engine.equation_error(theta, position, velocity, acceleration, m.time, command, m.time)
        return thin(error, m)


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
