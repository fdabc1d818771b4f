"""What the axis was doing at each instant: position, velocity, direction, time since a reversal, command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.force_balance.motion import differentiate, excitation_band, low_pass
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.sensors import body_sensors
from idloop.validation.regions import STANDING, direction_of, since_reversal

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Model

Array = NDArray[np.float64]

# The smoothing filter passes this many times the excited band: what is sorted by is not what is judged.
_FILTER_RATIO = 5.0
# Where it can, it leaves the noise below this share of the typical speed, but passes so many periods of a record.
_NOISE_SHARE, _LEAST_PERIODS = 0.1, 50.0
# A speed within this many standard deviations of its noise is no motion.
_NOISE_MARGIN = 4.0
# Fewer measurements than this say nothing about a motion.
_FEWEST = 50
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Doing:
    """State of one body and of the command, for sorting errors by it.

    Attributes
    ----------
    body : str
        Whose motion it is.
    position_unit, command_unit : str
    time, command : array, shape (n,)
        Instants [s] and the command that holds there.
    position, velocity : array, shape (n,), or None
        Smoothed measurement; None where there is no sensor that tells.
    direction, since : array, shape (n,), or None
        1 forward, -1 backward, 0 standing; time since the last reversal [s].
    floor : float
        Speed below which the body counts as standing.
    """

    body: str
    position_unit: str
    command_unit: str
    time: Array
    command: Array
    position: Array | None
    velocity: Array | None
    direction: Array | None
    since: Array | None
    floor: float

    def at(self, time: Array, command: Array | None = None) -> Doing:
        """Return the state at other instants, by the nearest sample; with another command if one is given."""
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        index = after - (time - self.time[after - 1] < self.time[after] - time)

        def picked(values: Array | None) -> Array | None:
            return None if values is None else values[index]

        return Doing(
            self.body, self.position_unit, self.command_unit, time,
            self.command[index] if command is None else command,
            picked(self.position), picked(self.velocity), picked(self.direction), picked(self.since), self.floor,
        )  # fmt: skip


def doing_of(model: Model, data: Data, body: str) -> Doing:
    """Read off a record what a body was doing; the nearest measured body stands in for one without a sensor.

    Parameters
    ----------
    model : Model
    data : Data
    body : str
        Name of the body.
    """
    sensors = body_sensors(model)
    wanted = model.bodies.index(body)
    position = velocity = direction = since = None
    floor = 0.0
    grid = _grid(data)
    for index in sorted(range(len(sensors)), key=lambda i: (abs(i - wanted), i)):
        place, speed = (None if row is None else _series(model, data, row, grid) for row in sensors[index])
        if place is None and speed is None:
            continue
        position, velocity, floor = _motion(place, speed, data.sample_time)
        if grid is not data.time:
            position = None if position is None else np.interp(data.time, grid, position)
            velocity = np.interp(data.time, grid, velocity)
        floor = max(floor, STANDING * float(np.sqrt(np.mean(velocity**2))))
        direction = direction_of(velocity, floor)
        since, _ = since_reversal(data.time, direction)
        body = model.bodies[index]
        break
    return Doing(
        body, model.units.position, model.input.unit, data.time, data.held_input(),
        position, velocity, direction, since, floor,
    )  # fmt: skip


def _grid(data: Data) -> Array:
    """Even instants to filter on: the record's own where they are even."""
    if np.ptp(np.diff(data.time)) < 1e-2 * data.sample_time:
        return data.time
    return np.arange(data.time[0], data.time[-1] + 1e-6 * data.sample_time, data.sample_time)


def _series(model: Model, data: Data, row: int, grid: Array) -> Array | None:
    """One output in position units on the grid, gaps bridged by straight lines; None when it is hardly measured."""
    values = data.output[:, row]
    known = np.isfinite(values)
    if np.sum(known) <= _FEWEST:
        return None
    if grid is not data.time or not np.all(known):
        values = np.interp(grid, data.time[known], values[known])
    return np.asarray(values / model.outputs[row].scale)


def _motion(place: Array | None, speed: Array | None, step: float) -> tuple[Array | None, Array, float]:
    """Smoothed position and velocity of one body, and the speed that noise alone shows."""
    if speed is not None:
        # White noise of a velocity, and of a differentiated position, up to a cut-off.
        raw, density, power = speed, noise_std(speed) * np.sqrt(2.0 * step), 0.5
    elif place is not None:
        raw, density, power = differentiate(place, step), noise_std(place) * TURN * np.sqrt(2.0 * step / 3.0), 1.5
    else:
        raise ValueError("neither position nor velocity")
    if not np.any(raw):
        return place, raw, 0.0
    cutoff = min(_FILTER_RATIO * excitation_band(raw, step), 0.45 / step)
    velocity = low_pass(raw, cutoff, step)
    typical = np.sqrt(max(float(np.mean(velocity**2)) - (density * cutoff**power) ** 2, 0.0))
    # Where noise would pass for motion, smooth more: to sort by, a slow motion seen clearly is worth more.
    quiet = (_NOISE_SHARE * typical / (_NOISE_MARGIN * density)) ** (1.0 / power) if density > 0.0 else np.inf
    least = min(_LEAST_PERIODS / (step * len(raw)), cutoff)
    if quiet < cutoff:
        cutoff = max(float(quiet), least)
        velocity = low_pass(raw, cutoff, step)
    position = None if place is None else low_pass(place, cutoff, step)
    return position, velocity, float(_NOISE_MARGIN * density * cutoff**power)
