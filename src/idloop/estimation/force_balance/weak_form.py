"""Force balance of a model along a measured motion, in weak form.

Every term is multiplied by a smooth test function and integrated. Integration by parts makes the inertial term one in
the measured velocity or position,

    ∫ J v̇ φ dt = -∫ J v φ̇ dt = ∫ J q φ̈ dt,

so that no signal is differentiated for the acceleration (Messenger and Bortz, Weak SINDy, Multiscale Modeling and
Simulation 19, 2021). The test function is φ(x) ∝ cos⁴(π x / 2) on a window of a given width.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby

import numpy as np

from idloop.arrays import Array, Integers
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.balance_terms import (
    BalanceTerms,
    Instants,
    MotionInWindows,
    balance_terms,
    windowed,
)
from idloop.estimation.force_balance.held_command import CommandAround, HeldCommand, Weight
from idloop.estimation.force_balance.motion import Motion, bridged, least_error_motion, measured_motion
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.physics import Engine, Model, kernel
from idloop.physics.conditions import Conditions
from idloop.physics.effect import INPUT

# Samples in the narrowest window, with the zeros at its ends: the least that resolves the second derivative.
NARROWEST = 9
# Windows that begin within the width of one: shifted cos⁴ then add up to a constant, and all samples have equal weight.
_OVERLAP = 3
# Two sensors of one body disagree when their velocities differ by more than so many times their noise.
_ABOVE_NOISE = 5.0
# Number of segments that count as independent.
BLOCKS = 40
# Least number of windows in a segment, so that the body moves in it.
_SHORTEST = 100
# Part of a segment that precedes it, for effects with memory.
_LEAD_IN = 0.1
# Largest rest speed, as a part of the typical speed.
LARGEST_REST = 0.03


@dataclass(frozen=True)
class WindowedRecord:
    """Measured motion of one record, for windows of one width."""

    # Gives each force its arguments: filtered only as the noise demands, whatever the width. A velocity that is smooth
    # over a window would turn late, and friction with it.
    motion: Motion
    inertial: Array  # shape (rows, bodies): weak acceleration of every body, from the unfiltered signals
    noise: Array  # shape (bodies,): standard deviation of the sensor noise in it
    rows: Integers  # shape (rows,): first sample of each window; windows over a gap are left out
    held: HeldCommand
    weight: Weight  # of a force in the weak acceleration of the driven body
    # Relative rms difference of two sensors' velocities, the largest of all bodies; 0 within their noise
    disagreement: float
    # shape (bodies,): rms difference of two sensors' weak accelerations; 0 within their noise
    acceleration_disagreement: Array
    conditions: Conditions | None = None

    def segments(self, count: int, part: float, width: int) -> list[WindowedRecord]:
        """So many segments, spread evenly, with a part of its windows of some width."""
        found = []
        for piece in np.array_split(np.arange(len(self.rows)), count):
            kept = piece[: max(round(part * len(piece)), 1)]
            if not len(kept):
                continue
            first, last = self.rows[kept[0]], self.rows[kept[-1]] + width
            first = max(first - round(_LEAD_IN * (last - first)), 0)
            rows = self.rows[kept] - first
            found.append(replace(self, motion=self.motion.part(first, last), inertial=self.inertial[kept], rows=rows))
        return found


@dataclass(frozen=True)
class WindowShares:
    """By what every window counts in the likelihood.

    By its command, given the motion, as far as the balance depends on the command; else (in a dead zone, beyond a
    limit, at standstill) by its motion, given the command.
    """

    command: Array  # shape (rows,): share of the command
    standing: Array  # shape (rows,): share of a body that friction holds, whatever the command
    strength: Array  # shape (rows,): log of the force per input for the share of the command


def test_functions(width: int, step: float) -> tuple[Array, Array, Array]:
    """The test function and its two derivatives, sampled.

    `width`: samples.
    `step`: sample time [s].
    Returns `value`, `first`, `second` (width,): weights of sums for the integrals ∫ φ f, ∫ φ̇ f and ∫ φ̈ f, with ∫ φ =
    1; φ is 0 at both ends. The derivatives are central differences: summed by parts, the sums are exact for a force
    that is constant from each sample to the next, as that of a held command is.
    """
    value = np.cos(0.5 * np.pi * np.linspace(-1.0, 1.0, width)) ** 4
    value[[0, -1]] = 0.0
    value /= np.sum(value)
    around = np.pad(value, 1)
    first = (around[2:] - around[:-2]) / (2.0 * step)
    second = (around[2:] - 2.0 * value + around[:-2]) / step**2
    return value, first, second


def windowed_record(model: Model, data: Data, motion: Motion, width: int) -> WindowedRecord:
    """Motion of one record in windows of ``width`` samples."""
    step = motion.sample_time
    value, first, second = test_functions(width, step)
    rows = np.arange(0, len(motion.time) - width + 1, round((width - 1) / _OVERLAP))
    middle = motion.time[rows] + 0.5 * (width - 1) * step
    rows = rows[~bridged(middle, model, data, 0.5 * width * step)]
    columns, noise, apart, counted = [], [], [], list[Weight]()
    disagreement = max(_disagreement(sensed, rows, value, first) for sensed in motion.measured)
    for sensed in motion.measured:
        choices = [
            (noise_std(series) * float(np.linalg.norm(weights)), series, weights)
            for series, weights in zip(sensed, (second, -first), strict=True)
            if series is not None
        ]
        quietest, *louder = sorted(choices, key=lambda choice: choice[0])
        noise.append(quietest[0])
        counted.append(Weight.POSITION if quietest[2] is second else Weight.VELOCITY)
        columns.append(windowed(quietest[1][:, None], rows, quietest[2])[:, 0])
        # Sensors that agree on the velocity need no second look.
        far = 0.0
        for level, series, weights in louder if disagreement > 0.0 else []:
            difference = columns[-1] - windowed(series[:, None], rows, weights)[:, 0]
            size = float(np.sqrt(np.mean(difference**2)))
            far = size if size > _ABOVE_NOISE * np.hypot(level, quietest[0]) else 0.0
        apart.append(far)
    held = HeldCommand(data.input_time, data.input)
    return WindowedRecord(
        motion, np.column_stack(columns), np.array(noise), rows, held, counted[0], disagreement, np.array(apart),
        data.conditions,
    )  # fmt: skip


def _disagreement(sensed: tuple[Array | None, Array | None], rows: Integers, value: Array, first: Array) -> float:
    """Relative rms difference of a velocity from the derivative of the position; 0 within the sensors' noise."""
    position, velocity = sensed
    if position is None or velocity is None:
        return 0.0
    from_position = windowed(position[:, None], rows, -first)
    from_velocity = windowed(velocity[:, None], rows, value)
    apart = float(np.sqrt(np.mean((from_position - from_velocity) ** 2)))
    noise = np.hypot(
        noise_std(position) * float(np.linalg.norm(first)), noise_std(velocity) * float(np.linalg.norm(value))
    )
    size = max(float(np.sqrt(np.mean(from_position**2))), float(np.sqrt(np.mean(from_velocity**2))), 1e-300)
    return apart / size if apart > _ABOVE_NOISE * noise else 0.0


def _command(tracks: Sequence[WindowedRecord], shift: float) -> CommandAround:
    """Command around each instant of all tracks, delayed by ``shift`` [s]."""
    found = []
    # Segments of one record share its command.
    for _, several in groupby(tracks, key=lambda track: id(track.held)):
        own = list(several)
        time = np.concatenate([track.motion.time for track in own])
        found.append(own[0].held.around(time - shift, own[0].motion.sample_time, own[0].weight))
    return CommandAround.joined(found)


def _free_timing(engine: Engine) -> bool:
    """Whether the model itself has no delay or lag of the command."""
    return not any(active.effect.site == INPUT and active.effect.lags for active in engine.model.effects)


class WeakForm:
    """Unexplained force of a model, window by window.

    `engine`: compiled model; every body is measured.
    `data`: the records.
    `tracks`: one for each record or segment of one, all of one width.
    `width`: samples in a window.
    `rest_speed`: speed below which a body counts as at rest [m/s or rad/s]; by default from the noise of these records.
    `motions`: of the whole records, where the tracks are segments of them.

    Attributes
    ----------
    starts : array of int, shape (tracks + 1,)
        First row of each track, and the number of all.
    free_timing : bool
        Whether the time from the stamp of a command to its action is estimated: not where it is an effect of the model.
    shares : dict of bytes to WindowShares
        Cache for the last point, by its bytes.
    """

    def __init__(
        self,
        engine: Engine,
        data: Sequence[Data],
        tracks: Sequence[WindowedRecord],
        width: int,
        rest_speed: float | None = None,
        motions: Sequence[Motion] | None = None,
    ) -> None:
        if rest_speed is None:
            rest_speed = float(np.median([np.max(track.motion.rest_speed) for track in tracks]))
        self.rest_speed = rest_speed
        self.engine, self.data, self.tracks, self.width = engine, tuple(data), tuple(tracks), width
        self.motions = tuple(track.motion for track in tracks) if motions is None else tuple(motions)
        self.starts = np.concatenate([[0], np.cumsum([len(track.rows) for track in tracks])])
        self.sample_time = float(np.median([track.motion.sample_time for track in tracks]))
        samples = np.concatenate([[0], np.cumsum([len(track.motion.time) for track in tracks])])
        # Shared by all models in the same windows.
        self._along = MotionInWindows(
            [_instants(track) for track in tracks],
            partial(_command, self.tracks),
            np.concatenate([track.rows + first for track, first in zip(tracks, samples[:-1], strict=True)]),
            test_functions(width, self.sample_time)[0],
            np.concatenate([track.inertial for track in tracks]),
            max(rest_speed, LARGEST_REST * self.typical_speed),
        )
        self._subsampled: dict[int, WeakForm] = {}
        self._for(engine)

    def _for(self, engine: Engine) -> None:
        """Clear all that depends on the model."""
        self.engine, self.free_timing = engine, _free_timing(engine)
        self._delayed = any(active.effect.delay for active in engine.model.effects)
        self._balance: BalanceTerms | None = None
        self._inertias = [f"{body}.inertia" for body in engine.model.bodies]
        self._valued: tuple[bytes | None, Mapping[str, float]] = (None, {})
        self.forget()

    @property
    def inertial(self) -> Array:
        """Weak acceleration of every body in every window, shape (rows, bodies)."""
        return self._along.inertial

    def with_engine(self, engine: Engine) -> WeakForm:
        """The same windows for another model."""
        other = copy(self)
        WeakForm._for(other, engine)
        return other

    def in_windows(self, width: int) -> WeakForm | None:
        """The same records in windows of another width; None where a record has too few samples."""
        return weak_form(self.engine, self.data, width, motions=self.motions)

    def with_rest_speed(self, rest_speed: float) -> WeakForm:
        """The same windows with another rest speed [m/s or rad/s]."""
        other = copy(self)
        other.rest_speed = rest_speed
        other.__dict__.pop("_slow", None)
        other.forget()
        return other

    @cached_property
    def typical_speed(self) -> float:
        """Root mean square of the driven body's velocity [m/s or rad/s]."""
        return float(np.sqrt(np.mean(np.concatenate([track.motion.velocity[:, 0] for track in self.tracks]) ** 2)))

    def forget(self) -> None:
        """Clear the cache."""
        self._known = b"", np.zeros(0)
        self.shares: dict[bytes, WindowShares] = {}

    def subsampled(self, most: int) -> WeakForm:
        """About so many of the windows, in segments spread evenly over the records; all where there are fewer."""
        total = int(self.starts[-1])
        if total <= most:
            return self
        if most not in self._subsampled:
            number, part = min(BLOCKS, max(most // _SHORTEST, 1)), most / total
            tracks = [
                piece
                for track in self.tracks
                for piece in track.segments(max(round(number * len(track.rows) / total), 1), part, self.width)
            ]
            self._subsampled[most] = WeakForm(self.engine, self.data, tracks, self.width, self.rest_speed, self.motions)
        return self._subsampled[most].with_rest_speed(self.rest_speed).with_engine(self.engine)

    def with_reversed_command(self) -> WeakForm:
        """The same motion with the opposite sign of the command."""
        reversed_ = {id(track.held): track.held.reversed() for track in self.tracks}
        tracks = [replace(track, held=reversed_[id(track.held)]) for track in self.tracks]
        return WeakForm(self.engine, self.data, tracks, self.width, self.rest_speed)

    def with_shifted_position(self, body: int, shift: float) -> WeakForm:
        """The same windows with another zero of the position of a body [m or rad]."""
        tracks = [replace(track, motion=track.motion.shifted(body, shift)) for track in self.tracks]
        return WeakForm(self.engine, self.data, tracks, self.width, self.rest_speed)

    @property
    def noise(self) -> Array:
        """Standard deviation of the weak acceleration's noise by body, over all rows."""
        return self._pooled([track.noise for track in self.tracks])

    @property
    def acceleration_disagreement(self) -> Array:
        """Rms difference of two sensors' weak accelerations by body, over all rows; 0 within their noise."""
        return self._pooled([track.acceleration_disagreement for track in self.tracks])

    @property
    def command_noise(self) -> float:
        """Standard deviation of a window's mean command by the noise of a measured command, 0 of a held one."""
        samples = [len(data.time) for data in self.data]
        noise = np.sqrt(np.average([data.command_noise**2 for data in self.data], weights=samples))
        return float(noise * np.linalg.norm(test_functions(self.width, self.sample_time)[0]))

    def _pooled(self, rms: Sequence[Array]) -> Array:
        squares = [len(track.rows) * value**2 for track, value in zip(self.tracks, rms, strict=True)]
        return np.asarray(np.sqrt(np.sum(squares, axis=0) / self.starts[-1]))

    def residual(self, theta: Array, shift: float) -> Array:
        """Unexplained force of every window: inertial force minus all modelled forces.

        `theta` (k,): free parameters.
        `shift`: time from the stamp of a command to its action [s].
        Returns shape (rows, bodies).
        """
        # Cached: a fit, its scale and its likelihood need the same point in turn.
        key = np.append(theta, shift).tobytes()
        known, residual = self._known
        if known != key:
            if np.isfinite(shift) and self.engine.is_valid(theta):
                balance, values, timing = self._at(theta, shift)
                residual = balance.residual(values, timing, self.rest_speed)
            else:
                residual = np.full(self.inertial.shape, np.nan)
            residual.flags.writeable = False
            self._known = key, residual
        return residual

    def _at(self, theta: Array, shift: float) -> tuple[BalanceTerms, Mapping[str, float], float]:
        """The balance, the values of all parameters, and the total delay of the command [s]."""
        values, timing = self._values(theta), shift
        if self._delayed:
            timing += float(self.engine.layout(theta).axis.constants[kernel.DELAY])
        if self._balance is None:
            self._balance = balance_terms(self.engine.model, self._along)
        return self._balance, values, timing

    def inertia(self, theta: Array) -> Array:
        """Inertia of every body, shape (bodies,)."""
        values = self._values(theta)
        return np.array([values[name] for name in self._inertias])

    def gain(self, theta: Array) -> float:
        """Magnitude of the drive's gain [force per input], above 0."""
        return max(abs(self._values(theta)["drive.gain"]), 1e-300)

    def _values(self, theta: Array) -> Mapping[str, float]:
        """Values of all parameters; the last ones are kept."""
        key = theta.tobytes()
        if self._valued[0] != key:
            self._valued = key, self.engine.values(theta)
        return self._valued[1]

    def slope(self, theta: Array, shift: float) -> Array:
        """Derivative of the driven body's balance by the command in every window, shape (rows,) [force per input].

        The density of the recorded command is that of the unexplained force times this derivative, at least 0:
        parameters that switch the command off, such as a saturation, a long lag or a large friction, gain nothing.
        """
        balance, values, timing = self._at(theta, shift)
        return balance.slope(values, timing, self.rest_speed)

    def drives(self, theta: Array, shift: float, least: float) -> tuple[float, Array]:
        """Response of the drive's force to the command: over all windows, and in each.

        `theta`, `shift`: as of `residual`.
        `least`: derivative above which a window has full weight in the response over all windows [force per input].
        Returns `overall`: standard deviation of the force over that of the command, above 0 [force per input].
        and `each` (rows,): derivative, at least 0 [force per input].
        """
        balance, values, timing = self._at(theta, shift)
        if not balance.inputs:
            gain = self.gain(theta)
            return gain, np.full(len(self.inertial), gain)
        drive, each = balance.drives(values, timing)
        passed = np.minimum(each / least, 1.0)
        return max(_deviation(drive, passed) / max(_deviation(self._along.weak_command, passed), 1e-300), 1e-300), each

    @property
    def standing(self) -> Array:
        """Part of every window in which friction holds the driven body at rest, shape (rows,)."""
        first = self.engine.model.bodies[0]
        held = any(one.at == first and one.effect.friction is not None for one in self.engine.model.effects)
        return self._slow if held else np.zeros(len(self.inertial))

    @cached_property
    def _slow(self) -> Array:
        """Part of every window in which the driven body counts as at rest, shape (rows,)."""
        return self._along.weak((np.abs(self._along.whole.velocity[:, 0]) < self.rest_speed).astype(float))

    def _along_velocity(self, body: int) -> Array:
        """Velocity of a body, its sign and a constant in every window, shape (rows, 3)."""
        velocity = self._along.whole.velocity[:, body]
        series = (velocity, np.sign(velocity), np.ones_like(velocity))
        return np.column_stack([self._along.weak(values) for values in series])

    def beside_inertia(self, body: int) -> Array:
        """The same and forces over the position, shape (rows, k): regressors beside the acceleration."""
        position = self._along.whole.position[:, body]
        series = (np.sin(position), np.cos(position)) if self.engine.model.units.position == "rad" else (position,)
        return np.column_stack([self._along_velocity(body), *(self._along.weak(values) for values in series)])

    @cached_property
    def motion_per_input(self) -> Array:
        """Log of the density of a window's acceleration over that of its command, shape (rows,) [input/(position/s²)].

        A window counts by p(command | motion) p(motion), or by p(motion | command) p(command): this ratio makes both
        comparable.
        """
        acceleration, command = self.inertial[:, 0], self._along.weak_command
        return log_density(acceleration, scale_of(acceleration)) - log_density(command, scale_of(command))

    @cached_property
    def reliability(self) -> float:
        """Share of the power of the driven body's weak acceleration that is not sensor noise, at most 1.

        Without the part that the velocity explains. Least squares underestimate the inertia by this ratio (Fuller,
        *Measurement Error Models*, 1987).
        """
        acceleration = self.inertial[:, 0]
        beside = self._along_velocity(0)
        left = float(np.var(acceleration - beside @ np.linalg.lstsq(beside, acceleration, rcond=None)[0]))
        return 1.0 - float(self.noise[0]) ** 2 / max(left, 1e-300)

    @property
    def disagreement(self) -> float:
        """Largest relative difference of two sensors' velocities of one body; 0 within their noise."""
        return max(track.disagreement for track in self.tracks)

    @cached_property
    def widest(self) -> int:
        """Samples in the widest windows that resolve the motion: about a period of four times its band."""
        motions = [measured_motion(self.engine.model, one) for one in self.data]
        band = max(motion.comparison_band for motion in motions if motion is not None)
        return max(round(1.0 / (band * self.sample_time)), NARROWEST)

    def drive(self, theta: Array, shift: float) -> Array:
        """Force of the drive in every window, shape (rows,)."""
        balance, values, timing = self._at(theta, shift)
        return balance.drives(values, timing)[0]

    @property
    def motion(self) -> Instants:
        """Measured motion at the instants of all records."""
        return self._along.whole

    def command(self, shift: float) -> Array:
        """Command at the instants of all records, delayed by ``shift`` [s], shape (n,)."""
        return _command(self.tracks, shift).mean

    def weak(self, signals: Array) -> Array:
        """Means over every window, shape (rows, k), of signals at the instants of all records (n, k)."""
        return self._along.weak(signals)

    def weak_derivative(self, signals: Array) -> Array:
        """The same of the derivatives of the signals, which are not differentiated: -∫ φ̇ f dt."""
        first = test_functions(self.width, self.sample_time)[1]
        return np.asarray(windowed(np.ascontiguousarray(signals), self._along.rows, -first))

    @property
    def record_places(self) -> Integers:
        """Place of the record of every instant of `motion`, shape (n,)."""
        held = dict.fromkeys(id(track.held) for track in self.tracks)
        places = {one: place for place, one in enumerate(held)}
        return np.concatenate([np.full(len(one.motion.time), places[id(one.held)]) for one in self.tracks])

    def along(self, what: str, body: int = 0) -> Array:
        """A signal at the middle of every window: ``time``, ``command``, or ``position`` or ``velocity`` of a body."""
        found = []
        for track in self.tracks:
            m = track.motion
            series = {"time": m.time, "position": m.position[:, body], "velocity": m.velocity[:, body]}
            values = _command([track], 0.0).mean if what == "command" else series[what]
            found.append(values[track.rows + self.width // 2])
        return np.concatenate(found)


def _instants(track: WindowedRecord) -> Instants:
    motion = track.motion
    # Contiguous, as compiled code expects them.
    time, position, velocity, acceleration = (
        np.ascontiguousarray(part) for part in (motion.time, motion.position, motion.velocity, motion.acceleration)
    )
    return Instants(time, position, velocity, acceleration, track.conditions, motion.turned)


def _deviation(values: Array, weights: Array) -> float:
    """Standard deviation of weighted values."""
    total = max(float(np.sum(weights)), 1e-300)
    mean = float(np.sum(weights * values)) / total
    return float(np.sqrt(np.sum(weights * (values - mean) ** 2) / total))


def weak_form(
    engine: Engine,
    data: Sequence[Data],
    width: int,
    rest_speed: float | None = None,
    motions: Sequence[Motion] | None = None,
) -> WeakForm | None:
    """Weak form of some records, with ``width`` samples in a window.

    None where some body is not measured, or a record has too few samples. The motion of every record is found here
    unless given, as from windows of another width.
    """
    model = engine.model
    if engine.layout(None).bodies != len(model.bodies) or any(len(one.time) < 4 * width for one in data):
        return None
    found = [least_error_motion(model, one) for one in data] if motions is None else motions
    known = [motion for motion in found if motion is not None]
    if len(known) < len(data):
        return None
    tracks = [windowed_record(model, one, motion, width) for one, motion in zip(data, known, strict=True)]
    return WeakForm(engine, data, tracks, width, rest_speed) if all(len(track.rows) for track in tracks) else None
