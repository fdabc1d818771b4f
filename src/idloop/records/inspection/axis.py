"""One joint of a recording: its command, its position and its velocity, on their own stamps and on an even grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from idloop.arrays import Array
from idloop.records.bags.publishers import Publishers
from idloop.records.bags.stream import JointStream
from idloop.records.filtering import held_mean
from idloop.records.inspection.motion import analyse_motion, white_noise
from idloop.records.inspection.values import bad_readings
from idloop.records.inspection.wraps import Wraps, find_wraps

_MOST = 20_000  # samples on the grid at most: longer records are averaged in blocks, which changes no balance of forces
_HOLE = 5.0  # an interval of more than this many periods is a hole
_COVERED = 0.75  # share of a record within usual intervals, below which the mean interval is the period


@dataclass(frozen=True, eq=False)
class Grid:
    """Signals of an axis at even instants, shape (n,); NaN in holes."""

    period: float  # [s]
    # shape (n,): the command is the mean of the held one around each instant. All NaN where not recorded.
    time: Array
    position: Array
    velocity: Array
    command: Array
    speed: Array  # shape (n,): velocity, where the record has a true one, else the slope of the position
    noise: float  # standard deviation of the noise of `speed`


@dataclass(frozen=True, eq=False)
class Axis:
    """The streams of one joint."""

    joint: str
    time: Array  # shape (n,): stamps of the measurements [s from the first stamp of the recording], increasing
    # shape (n,): NaN where not measured; None where not recorded
    position: Array | None
    velocity: Array | None
    # shape (m,): stamps [s] and values of the held command; empty where not recorded
    input_time: Array = field(default_factory=lambda: np.zeros(0))
    command: Array = field(default_factory=lambda: np.zeros(0))
    command_name: str = ""  # ``joint.field``, "" without a command
    units: Mapping[str, str] = field(default_factory=dict)  # by ``joint.field``, where known
    has_reference: bool = False  # whether a reference was recorded
    # Where they come from
    measured_stream: JointStream | None = None
    command_stream: JointStream | None = None
    # Topics with two publishers; the joint has the messages of the more frequent one
    publishers: tuple[Publishers, ...] = ()
    trusts_velocity: bool = True  # whether the velocity is that of the position
    joined: bool = False  # whether command and motion may come from files of their own
    # Times and values of the readings of position, velocity or command that lie far outside of all others; the arrays
    # have NaN there
    bad: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    def without_bad_readings(self) -> Axis:
        """Return the axis with NaN in place of readings far outside of all others, which are in `bad`."""
        changed: dict[str, Array] = {}
        bad = {}
        for name, time in (("position", self.time), ("velocity", self.time), ("command", self.input_time)):
            value: Array | None = getattr(self, name)
            if value is not None and (rows := bad_readings(value)).size:
                bad[name] = (time[rows], value[rows])
                changed[name] = value.copy()
                changed[name][rows] = np.nan
        return replace(self, **changed, bad=bad) if bad else self  # type: ignore[arg-type]

    def name(self, signal: str) -> str:
        """``joint.signal``, or the name of the command."""
        return self.command_name if signal == "command" else f"{self.joint}.{signal}"

    def unit(self, signal: str) -> str:
        """Unit of a signal of this joint, or of the command; those of the topics where none is given."""
        unit = self.units.get(self.name(signal))
        if signal == "command":
            return unit if unit and unit != "-" else "command units"
        return unit or {"position": "rad", "velocity": "rad/s"}[signal]

    @property
    def known_command(self) -> Array:
        """Values of the command without missing ones."""
        return self.command[np.isfinite(self.command)]

    @property
    def columns(self) -> dict[str, Array]:
        """Position and velocity (n,) by ``joint.field``, as recorded."""
        found = {"position": self.position, "velocity": self.velocity}
        return {self.name(key): value for key, value in found.items() if value is not None}

    @property
    def signals(self) -> dict[str, Array]:
        """Position without the jumps of its encoder and velocity (n,), by field, where recorded."""
        found = {"position": self.place, "velocity": self.velocity}
        return {key: value for key, value in found.items() if value is not None}

    @property
    def motions(self) -> dict[str, Array]:
        """`signals` by ``joint.field``."""
        return {self.name(key): value for key, value in self.signals.items()}

    @cached_property
    def wraps(self) -> Wraps | None:
        """Where the position jumps by the range of its encoder, None where it does not."""
        return None if self.position is None else find_wraps(self.position)

    @cached_property
    def place(self) -> Array | None:
        """Position (n,) without the jumps of its encoder."""
        return self.position if self.wraps is None else self.wraps.unwrapped

    @cached_property
    def resolution(self) -> dict[str, float]:
        """Step of position and velocity that their sensors make; 0 where not recorded."""
        steps = {name: sensor_step(value) for name, value in self.signals.items()}
        return {"position": 0.0, "velocity": 0.0} | steps

    @cached_property
    def period(self) -> float:
        """Usual interval of the measurements [s]; NaN below two."""
        step = np.diff(self.time)
        if not step.size:
            return float("nan")
        usual = float(np.median(step))
        covered = float(np.sum(step[step < _HOLE * usual])) / float(np.sum(step))
        return usual if covered > _COVERED else float(np.mean(step))

    @cached_property
    def grid(self) -> Grid | None:
        """Signals at even instants; None below 30 samples."""
        if self.time.size < 30 or not np.isfinite(self.period) or self.period <= 0.0:
            return None
        count = int((self.time[-1] - self.time[0]) / self.period) + 1
        block = -(-count // _MOST)
        count = count // block * block
        even = self.time[0] + self.period * np.arange(count)
        edges = self.time[0] + self.period * (np.arange(count + 1) - 0.5)
        columns = [
            even,
            _at(even, self.time, self.place, self.period),
            _at(even, self.time, self.velocity, self.period),
            _held_mean(edges, self.input_time, self.command),
        ]
        if block > 1:
            columns = [one.reshape(-1, block).mean(axis=1) for one in columns]
        time, place, velocity, command = columns
        period = block * self.period
        speed = velocity if self.trusts_velocity and np.isfinite(velocity).any() else _slope(place, period, self)
        known = speed[np.isfinite(speed)]
        noise = max(white_noise(known), 0.3 * sensor_step(known)) if known.size > 30 else 0.0
        return Grid(period, time, place, velocity, command, speed, noise)


def _at(even: Array, time: Array, value: Array | None, period: float) -> Array:
    known = np.zeros(time.size, dtype=bool) if value is None else np.isfinite(value)
    if value is None or known.sum() < 2:
        return np.full(even.size, np.nan)
    time, value = time[known], value[known]
    period = max(period, float(np.median(np.diff(time))))
    # Rounding must not put an instant beyond the sample that it is of.
    after = np.clip(np.searchsorted(time, even - 1e-6 * period), 1, time.size - 1)
    held = np.interp(even, time, value, left=np.nan, right=np.nan)
    held[time[after] - time[after - 1] > _HOLE * period] = np.nan
    return held


def _held_mean(edges: Array, time: Array, value: Array) -> Array:
    """Mean of a held signal between consecutive edges (n + 1,) -> (n,); NaN before its first value."""
    known = np.isfinite(value)
    time, value = time[known], value[known]
    if time.size < 2:
        return np.full(edges.size - 1, np.nan)
    return np.where(edges[:-1] < time[0], np.nan, held_mean(time, value, edges))


def _slope(place: Array, period: float, axis: Axis) -> Array:
    """Slope of a position over the shortest window in which its steps and its noise are small."""
    slope, known = np.full(place.size, np.nan), place[np.isfinite(place)]
    if known.size < 60:
        return slope
    noise = max(white_noise(known), 0.3 * axis.resolution["position"])
    for half in (1, 2, 4, 8, 16):
        slope = np.full(place.size, np.nan)
        slope[half:-half] = (place[2 * half :] - place[: -2 * half]) / (2.0 * half * period)
        if np.nanstd(slope) > 10.0 * noise / (half * period):
            break
    return slope


def sensor_step(value: Array) -> float:
    """Step between values of a quantised signal (n,); the smallest of all where most are no multiples of one step.

    A few odd values, such as those of a decoder that counts four edges and loses one, do not count.
    """
    known = value[np.isfinite(value)]
    change = np.abs(np.diff(known))
    change = change[change > 1e-12 * float(np.ptp(known))] if known.size else change
    if not change.size:
        return 0.0
    step = float(np.percentile(change, 2.0))
    near = np.abs(change / step - np.round(change / step)) < 0.01 * np.maximum(change / step, 1.0)
    if change.size > 20 and np.mean(near) > 0.9:
        return step
    motion = analyse_motion(value)
    return 0.0 if motion is None else motion.resolution
