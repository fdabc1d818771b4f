"""Operating state of the axis at each instant: position, velocity, direction, time since a reversal, command."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.motion import differentiate, excitation_band, low_pass
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.sensors import body_sensors
from idloop.physics import Model

# Cut-off of the smoothing filter over the excited band: errors are sorted by a smooth state.
_FILTER_RATIO = 5.0
# It keeps the noise below this share of the typical speed, but passes at least so many periods of a record.
_NOISE_SHARE, _LEAST_PERIODS = 0.1, 50.0
# A speed within this many standard deviations of its noise counts as standing.
_NOISE_MARGIN = 4.0
# Fewest measurements of a motion.
_FEWEST = 50
TURN = 2.0 * np.pi
# A speed below this share of the typical one counts as standing.
STANDING = 0.02


@dataclass(frozen=True)
class OperatingState:
    """State of one body and of the command, as classes for errors."""

    body: str  # body that is described
    position_unit: str
    command_unit: str
    # shape (n,): instants [s] and the held command
    time: Array
    command: Array
    # shape (n,): smoothed measurement; None without a sensor
    position: Array | None
    velocity: Array | None
    # shape (n,): 1 forward, -1 backward, 0 standing; time since the last reversal [s]
    direction: Array | None
    since: Array | None
    floor: float  # speed below which the body counts as standing

    def at(self, time: Array, command: Array | None = None) -> OperatingState:
        """State at other instants, by the nearest sample; with another command if one is given."""
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        index = after - (time - self.time[after - 1] < self.time[after] - time)

        def picked(values: Array | None) -> Array | None:
            return None if values is None else values[index]

        return OperatingState(
            self.body, self.position_unit, self.command_unit, time,
            self.command[index] if command is None else command,
            picked(self.position), picked(self.velocity), picked(self.direction), picked(self.since), self.floor,
        )  # fmt: skip


def operating_state(model: Model, data: Data, body: str) -> OperatingState:
    """Operating state of a body in a record; of the nearest measured body where it has no sensor."""
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
    return OperatingState(
        body, model.units.position, model.input.unit, data.time, data.held_input(),
        position, velocity, direction, since, floor,
    )  # fmt: skip


def _grid(data: Data) -> Array:
    """Even instants to filter on: the record's own where they are even."""
    if np.ptp(np.diff(data.time)) < 1e-2 * data.sample_time:
        return data.time
    return np.arange(data.time[0], data.time[-1] + 1e-6 * data.sample_time, data.sample_time)


def _series(model: Model, data: Data, row: int, grid: Array) -> Array | None:
    """One output in position units on the grid, gaps interpolated; None with too few measurements."""
    values = data.output[:, row]
    known = np.isfinite(values)
    if np.sum(known) <= _FEWEST:
        return None
    if grid is not data.time or not np.all(known):
        values = np.interp(grid, data.time[known], values[known])
    return np.asarray(values / model.outputs[row].scale)


def _motion(place: Array | None, speed: Array | None, step: float) -> tuple[Array | None, Array, float]:
    """Smoothed position and velocity of one body, and the speed from noise alone."""
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
    # A lower cut-off where noise would count as motion.
    quiet = (_NOISE_SHARE * typical / (_NOISE_MARGIN * density)) ** (1.0 / power) if density > 0.0 else np.inf
    least = min(_LEAST_PERIODS / (step * len(raw)), cutoff)
    if quiet < cutoff:
        cutoff = max(float(quiet), least)
        velocity = low_pass(raw, cutoff, step)
    position = None if place is None else low_pass(place, cutoff, step)
    return position, velocity, float(_NOISE_MARGIN * density * cutoff**power)


def direction_of(velocity: Array, floor: float = 0.0) -> Array:
    """Direction of motion: 1 forward, -1 backward, 0 standing.

    `velocity` (n,): NaN counts as standing. `floor`: speed from sensor noise alone; 2 % of the typical speed when that
    is more.
    """
    v = np.nan_to_num(velocity)
    typical = float(np.sqrt(np.mean(v**2)))
    return np.where(np.abs(v) > max(STANDING * typical, floor), np.sign(v), 0.0)


def since_reversal(time: Array, direction: Array) -> tuple[Array, Integers]:
    """Time since the last reversal.

    `time` (n,): instants [s]. `direction` (n,): result of `direction_of`. Standing still between two stretches of one
    direction is no reversal, nor is the first start from rest. Returns `since` (n,): time [s]; infinite before the
    first reversal. `turns`: first sample of each new direction.
    """
    # The last direction of motion, held while standing.
    index = np.maximum.accumulate(np.where(direction != 0.0, np.arange(len(direction)), 0))
    last = direction[index]
    turns = np.flatnonzero((np.diff(last) != 0.0) & (last[:-1] != 0.0)) + 1
    since = np.full(len(direction), np.inf)
    if len(turns):
        previous = np.searchsorted(turns, np.arange(len(direction)), side="right") - 1
        known = previous >= 0
        since[known] = time[known] - time[turns[previous[known]]]
    return since, turns


def motion_regions(time: Array, velocity: Array) -> dict[str, Mask]:
    """Classify samples by the motion: standing, forward, backward, just after a reversal.

    `time` (n,): instants [s]. `velocity` (n,): velocity of the driven body; NaN counts as standing. Returns shape (n,):
    disjoint, together all samples.
    """
    direction = direction_of(velocity)
    since, turns = since_reversal(time, direction)
    # "Just after" is a tenth of the typical time between reversals.
    spacing = float(np.median(np.diff(time[turns]))) if len(turns) > 2 else float(time[-1] - time[0])
    fresh = since < 0.1 * spacing
    return {
        "after a reversal": fresh & (direction != 0.0),
        "forward": ~fresh & (direction > 0.0),
        "backward": ~fresh & (direction < 0.0),
        "standing": direction == 0.0,
    }


def error_share(error: Array, regions: dict[str, Mask]) -> dict[str, dict[str, float]]:
    """Share of the squared error and of the time in each region.

    `error` (n,): error of one output; NaN samples are left out. `regions`: result of `motion_regions`. Returns:
    ``{region: {"error": share, "time": share}}``; the shares add up to 1.
    """
    square = np.where(np.isfinite(error), error, 0.0) ** 2
    total, count = float(np.sum(square)), max(int(np.sum(np.isfinite(error))), 1)
    return {
        name: {
            "error": float(np.sum(square[inside])) / total if total > 0.0 else 0.0,
            "time": float(np.sum(np.isfinite(error[inside]))) / count,
        }
        for name, inside in regions.items()
    }


def smooth_velocity(time: Array, position: Array) -> Array:
    """Velocity from a measured position, heavily smoothed, to classify samples; NaN gaps are interpolated."""
    known = np.isfinite(position)
    filled = np.interp(time, time[known], position[known])
    step = float(np.median(np.diff(time)))
    return differentiate(low_pass(filled, 0.05 / step, step), step)
