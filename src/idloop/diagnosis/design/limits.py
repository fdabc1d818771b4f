"""Limits of a suggested experiment: command, travel, speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.sensors import body_sensors

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# A motion that exceeds its limit by less than this share is inside: limits read off data are met exactly.
_TOLERANCE = 1e-6
# Share of the time that a controller's command may sit at its largest value.
_SATURATED = 0.1


@dataclass(frozen=True)
class Limits:
    """What an experiment may do; None leaves it to the data so far.

    Attributes
    ----------
    command : float, optional
        Largest absolute command [input unit].
    position : (float, float), optional
        Lowest and highest position [position unit].
    velocity : float, optional
        Largest absolute velocity [position unit / s].
    rate : float, optional
        Largest absolute change of the command [input unit / s]; unlimited where it is not given.
    """

    command: float | None = None
    position: tuple[float, float] | None = None
    velocity: float | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        for name in ("command", "velocity", "rate"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise InputError(f"limits: {name} is {value}; give a positive number")
        if self.position is not None and not self.position[0] < self.position[1]:
            low, high = self.position
            raise InputError(f"limits: position range {low:g} .. {high:g}; give the lower end first")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)

    def completed(self, model: Model, records: Sequence[Record]) -> Limits:
        """Limits completed by the largest command and motion so far, where these are measured."""
        command, position, velocity = self.command, self.position, self.velocity
        if command is None:
            command = max(float(np.max(np.abs(record.input))) for record in records)
            section = model.controller or {}
            limit = section.get("limit")
            if limit is not None and _closed(records):
                command = max(command, float(limit))
        motions = [motion(model, record) for record in records]
        if position is None:
            lows = [float(np.min(m[0])) for m in motions if m[0].size]
            highs = [float(np.max(m[0])) for m in motions if m[0].size]
            position = (min(lows), max(highs)) if lows and min(lows) < max(highs) else None
        if velocity is None:
            most = max((_largest_speed(m[1]) for m in motions if m[1].size), default=0.0)
            velocity = most if most > 0.0 else None
        return Limits(command, position, velocity, self.rate)

    def excess(self, model: Model, record: Record) -> float:
        """Largest ratio of a noise-free simulated record to the limits; at most 1 is inside."""
        worst = [0.0]
        if not np.all(np.isfinite(record.output[~np.isnan(record.output)])) or np.any(np.isnan(record.output)):
            return np.inf
        if self.command is not None:
            worst.append(float(np.max(np.abs(record.input))) / self.command)
            if record.reference is not None:
                # A loop that saturates is open.
                at_limit = np.mean(np.abs(record.input) >= (1.0 - _TOLERANCE) * np.max(np.abs(record.input)))
                worst.append(float(at_limit) / _SATURATED)
        if self.rate is not None and record.input.size > 1:
            steepest = float(np.max(np.abs(np.diff(record.input)) / np.diff(record.input_time)))
            worst.append(steepest / self.rate)
        place, speed = motion(model, record)
        if self.position is not None and place.size:
            low, high = self.position
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            worst.append(float(np.max(np.abs(place - middle))) / half)
        if self.velocity is not None and speed.size:
            worst.append(float(np.max(np.abs(speed))) / self.velocity)
        return max(worst) / (1.0 + _TOLERANCE)


def motion(model: Model, record: Record) -> tuple[Array, Array]:
    """Positions and velocities of all measured bodies in a record, one after the other [position unit, per s].

    Where only one of the two is measured, the other is computed from it; empty where nothing is measured.
    """
    places, speeds = [], []
    for place, speed in body_sensors(model):
        position = _column(model, record, place)
        velocity = _column(model, record, speed)
        if position is not None:
            places.append(position[1])
            if velocity is None:
                speeds.append(_differentiated(*position))
        if velocity is not None:
            speeds.append(velocity[1])
            if position is None:
                places.append(np.cumsum(velocity[1]) * record.sample_time)
    empty = np.zeros(0)
    return (np.concatenate(places) if places else empty, np.concatenate(speeds) if speeds else empty)


def _column(model: Model, record: Record, index: int | None) -> tuple[Array, Array] | None:
    if index is None:
        return None
    known = np.isfinite(record.output[:, index])
    if np.sum(known) < 2:
        return None
    return record.time[known], record.output[known, index] / model.outputs[index].scale


def _differentiated(time: Array, position: Array) -> Array:
    """Slope over a five-hundredth of the record, so that sensor noise does not count as speed."""
    reach = max(len(time) // 500, 1)
    if len(time) <= reach:
        return np.zeros(0)
    return np.asarray((position[reach:] - position[:-reach]) / (time[reach:] - time[:-reach]))


def _largest_speed(velocity: Array) -> float:
    """Largest speed, a thousandth of the samples left out as outliers."""
    return float(np.quantile(np.abs(velocity), 0.999))


def _closed(records: Sequence[Record]) -> bool:
    return any(follows_reference(record) for record in records)


def follows_reference(record: Record) -> bool:
    """Whether a reference was recorded, so that a controller was at work."""
    return record.reference is not None and bool(np.any(np.isfinite(record.reference)))
