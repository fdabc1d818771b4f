"""The force balance of a model along a measured motion, in weak form.

Every term is multiplied by a smooth test function and integrated. By parts, the inertial term becomes one in the
measured velocity or position themselves,

    ∫ J v̇ φ dt = -∫ J v φ̇ dt = ∫ J q φ̈ dt,

so that no measured signal is differentiated to find an acceleration (Messenger and Bortz, Weak SINDy, Multiscale
Modeling and Simulation 19, 2021). The test function is φ(x) ∝ cos⁴(π x / 2) on a window of a given width.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.balance_terms import BalanceTerms, Instants, MotionInWindows, balance_of, windowed
from idloop.estimation.force_balance.held_command import CommandAround, HeldCommand
from idloop.estimation.force_balance.motion import Motion, bridged, measured_motion
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.physics import Engine, kernel
from idloop.physics.conditions import Conditions
from idloop.physics.effect import INPUT

Array = NDArray[np.float64]

# Samples in the narrowest window: fewer do not resolve the second derivative of the test function.
NARROWEST = 7
# A window passes frequencies up to about the inverse of its width; the motion is kept up to twice as much.
_BAND = 2.0
# Windows that overlap by half use all samples alike.
_OVERLAP = 2
# Two sensors of one body disagree where their velocities are further apart than so many times their noise.
_ABOVE_NOISE = 5.0
# Stretches that are taken as independent, into which records are cut.
BLOCKS = 40
# A stretch by itself has so many windows at least: of shorter ones a body hardly moves in any.
_SHORTEST = 100
# A stretch by itself is led in by this part of it, so that what has a memory has something to remember.
_LEAD_IN = 0.1
# No body whose speed is above this part of the typical one counts as standing.
LARGEST_REST = 0.03


@dataclass(frozen=True)
class Track:
    """Measured motion of one record, for windows of one width.

    Attributes
    ----------
    motion : Motion
        Band-limited; gives each force its arguments.
    inertial : array, shape (rows, bodies)
        Weak acceleration of every body, from the measured signals as they are.
    noise : array, shape (bodies,)
        Standard deviation of what the sensors' noise makes of it.
    rows : array of int, shape (rows,)
        First sample of each window; windows over a hole in the measurements are left out.
    held : HeldCommand
    conditions : Conditions or None
    disagreement : float
        Where two sensors see a body: their velocities' difference over the velocity as rms, the largest of all bodies;
        0 where it is no more than their noise.
    left_out : array, shape (2, bodies)
        Power of what the sensors see of the motion and the band leaves out, and of their noise, summed over samples.
    """

    motion: Motion
    inertial: Array
    noise: Array
    rows: NDArray[np.int64]
    held: HeldCommand
    disagreement: float
    left_out: Array
    conditions: Conditions | None = None

    def stretches(self, count: int, part: float, width: int) -> list[Track]:
        """So many stretches of it, evenly spread, that together have a part of its windows of some width."""
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
class Shares:
    """By what every window is told.

    By its command, given the motion, as far as the balance depends on that; else by its motion, given the command: in a
    dead zone, beyond a limit, at standstill.

    Attributes
    ----------
    told : array, shape (rows,)
        Share of the command.
    standing : array, shape (rows,)
        Share of a body that a friction holds, whatever the command.
    strength : array, shape (rows,)
        Log of the force per input where the command is told.
    """

    told: Array
    standing: Array
    strength: Array


def test_functions(width: int, step: float) -> tuple[Array, Array, Array]:
    """The test function and its two derivatives, sampled.

    Parameters
    ----------
    width : int
        Samples.
    step : float
        Sample time [s].

    Returns
    -------
    value, first, second : array, shape (width,)
        Sums that stand for the integrals ∫ φ f, ∫ φ̇ f and ∫ φ̈ f, with ∫ φ = 1. The first moment of φ̇ and the
        second of φ̈ are exact: a constant acceleration comes out as it is.
    """
    angle = 0.5 * np.pi * np.linspace(-1.0, 1.0, width + 2)[1:-1]
    rate = np.pi / ((width + 1) * step)
    time = (np.arange(width) - 0.5 * (width - 1)) * step
    value = np.cos(angle) ** 4
    first = -4.0 * rate * np.cos(angle) ** 3 * np.sin(angle)
    second = 4.0 * rate**2 * (3.0 * np.cos(angle) ** 2 * np.sin(angle) ** 2 - np.cos(angle) ** 4)
    value = value / np.sum(value)
    first = first / -np.sum(first * time)
    second = second - np.mean(second)
    second = second / (0.5 * np.sum(second * time**2))
    return value, first, second


def track_of(engine: Engine, data: Data, width: int) -> Track | None:
    """Prepare one record for windows of one width.

    Parameters
    ----------
    engine : Engine
    data : Data
    width : int
        Samples in a window.

    Returns
    -------
    Track or None
        None where some body is not measured, or the record has too few samples.
    """
    model = engine.model
    if engine.layout(None).bodies != len(model.bodies) or len(data.time) < 4 * width:
        return None
    motion = measured_motion(model, data, _BAND / (width * data.sample_time))
    if motion is None:
        return None
    step = motion.sample_time
    value, first, second = test_functions(width, step)
    rows = np.arange(0, len(motion.time) - width + 1, max(width // _OVERLAP, 1))
    middle = motion.time[rows] + 0.5 * (width - 1) * step
    rows = rows[~bridged(middle, model, data, 0.5 * width * step)]
    columns, noise = [], []
    for sensed in motion.measured:
        choices = [
            (noise_std(series) * float(np.linalg.norm(weights)), series, weights)
            for series, weights in zip(sensed, (second, -first), strict=True)
            if series is not None
        ]
        quietest = min(choices, key=lambda choice: choice[0])
        noise.append(quietest[0])
        columns.append(windowed(quietest[1][:, None], rows, quietest[2])[:, 0])
    held = HeldCommand(data.input_time, data.input, float(data.time[-1]))
    disagreement = max(_disagreement(sensed, rows, value, first) for sensed in motion.measured)
    return Track(
        motion, np.column_stack(columns), np.array(noise), rows, held, disagreement, _left_out(motion), data.conditions
    )


def _left_out(motion: Motion) -> Array:
    """Powers (2, bodies) of what a band leaves out of a measured motion and of the noise, by the quieter sensor."""
    found = []
    for kept, sensed in zip(zip(motion.position.T, motion.velocity.T, strict=True), motion.measured, strict=True):
        powers = [
            (float(np.sum((series - values) ** 2)), noise_std(series) ** 2 * len(series))
            for series, values in zip(sensed, kept, strict=True)
            if series is not None
        ]
        found.append(min(powers, key=lambda pair: pair[0] / max(pair[1], 1e-300)))
    return np.transpose(found)


def _disagreement(
    sensed: tuple[Array | None, Array | None], rows: NDArray[np.int64], value: Array, first: Array
) -> float:
    """How far a velocity is from the derivative of the position, over the velocity; 0 within the sensors' noise."""
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


def _command(tracks: Sequence[Track], shift: float) -> CommandAround:
    """Command around each instant of tracks one after the other, ``shift`` [s] earlier."""
    found = []
    # Stretches of one record share its command.
    for _, several in groupby(tracks, key=lambda track: id(track.held)):
        own = list(several)
        time = np.concatenate([track.motion.time for track in own])
        found.append(own[0].held.around(time - shift, own[0].motion.sample_time))
    return CommandAround.joined(found)


def _free_timing(engine: Engine) -> bool:
    """Whether the model itself has nothing that makes commands act later."""
    return not any(active.effect.site == INPUT and active.effect.lags for active in engine.model.effects)


class WeakForm:
    """Unexplained force of a model, window by window.

    Parameters
    ----------
    engine : Engine
        Compiled model, of which every body is measured.
    data : sequence of Data
        The records.
    tracks : sequence of Track
        One per record or stretch of one, all of one width.
    width : int
        Samples in a window.
    rest_speed : float, optional
        Speed below which a body counts as standing [m/s or rad/s]; by default as the noise of these records lets it
        be told.

    Attributes
    ----------
    starts : array of int, shape (tracks + 1,)
        First row of each track, and the number of all.
    free_timing : bool
        Whether the time from the stamp of a command to its action is estimated: not where the model has it itself.
    shares : dict of bytes to Shares
        By what every window is told at the point that was asked for last, by its bytes.
    """

    def __init__(
        self,
        engine: Engine,
        data: Sequence[Data],
        tracks: Sequence[Track],
        width: int,
        rest_speed: float | None = None,
    ) -> None:
        if rest_speed is None:
            rest_speed = float(np.median([np.max(track.motion.rest_speed) for track in tracks]))
        self.rest_speed = rest_speed
        self.engine, self.data, self.tracks, self.width = engine, tuple(data), tuple(tracks), width
        self.starts = np.concatenate([[0], np.cumsum([len(track.rows) for track in tracks])])
        self.sample_time = float(np.median([track.motion.sample_time for track in tracks]))
        samples = np.concatenate([[0], np.cumsum([len(track.motion.time) for track in tracks])])
        # Shared with the forms of other models in the same windows.
        self._along = MotionInWindows(
            [_instants(track) for track in tracks],
            partial(_command, self.tracks),
            np.concatenate([track.rows + first for track, first in zip(tracks, samples[:-1], strict=True)]),
            test_functions(width, self.sample_time)[0],
            np.concatenate([track.inertial for track in tracks]),
            max(rest_speed, LARGEST_REST * self.typical_speed),
        )
        self._thinned: dict[int, WeakForm] = {}
        self._for(engine)

    def _for(self, engine: Engine) -> None:
        """Keep nothing of another model."""
        self.engine, self.free_timing = engine, _free_timing(engine)
        self._delayed = any(active.effect.delay for active in engine.model.effects)
        self._balance: BalanceTerms | None = None
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

    def with_rest_speed(self, rest_speed: float) -> WeakForm:
        """The same windows with another speed below which a body counts as standing [m/s or rad/s]."""
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
        """Keep nothing of another model or speed."""
        self._known = b"", np.zeros(0)
        self.shares: dict[bytes, Shares] = {}

    def thinned(self, most: int) -> WeakForm:
        """About so many of the windows, in stretches evenly spread over the records; all where these are less."""
        total = int(self.starts[-1])
        if total <= most:
            return self
        if most not in self._thinned:
            number, part = min(BLOCKS, max(most // _SHORTEST, 1)), most / total
            tracks = [
                piece
                for track in self.tracks
                for piece in track.stretches(max(round(number * len(track.rows) / total), 1), part, self.width)
            ]
            self._thinned[most] = WeakForm(self.engine, self.data, tracks, self.width, self.rest_speed)
        return self._thinned[most].with_rest_speed(self.rest_speed).with_engine(self.engine)

    def turned(self) -> WeakForm:
        """The same motion with the sign of the command turned."""
        turned = {id(track.held): track.held.turned() for track in self.tracks}
        tracks = [replace(track, held=turned[id(track.held)]) for track in self.tracks]
        return WeakForm(self.engine, self.data, tracks, self.width, self.rest_speed)

    @property
    def noise(self) -> Array:
        """Standard deviation of the weak acceleration's noise by body, over all rows."""
        squares = [len(track.rows) * track.noise**2 for track in self.tracks]
        return np.asarray(np.sqrt(np.sum(squares, axis=0) / self.starts[-1]))

    def residual(self, theta: Array, shift: float) -> Array:
        """Unexplained force of every window: inertial force minus all modelled forces.

        Parameters
        ----------
        theta : array, shape (k,)
            Free parameters.
        shift : float
            From the stamp of a command to its action [s].

        Returns
        -------
        array, shape (rows, bodies)
        """
        # A fit, its scale and its likelihood ask for the same point one after the other.
        key = np.append(theta, shift).tobytes()
        known, residual = self._known
        if known != key:
            if self.engine.go_together(theta):
                balance, values, timing = self._at(theta, shift)
                residual = balance.residual(values, timing, self.rest_speed)
            else:
                residual = np.full(self.inertial.shape, np.nan)
            residual.flags.writeable = False
            self._known = key, residual
        return residual

    def _at(self, theta: Array, shift: float) -> tuple[BalanceTerms, Mapping[str, float], float]:
        """The balance, the values of all parameters, and the time from the stamp of a command to its action [s]."""
        values, timing = self.engine.values(theta), shift
        if self._delayed:
            timing += float(self.engine.layout(theta).axis.constants[kernel.DELAY])
        if self._balance is None:
            self._balance = balance_of(self.engine.model, self._along)
        return self._balance, values, timing

    def inertia(self, theta: Array) -> Array:
        """Inertia of every body, shape (bodies,)."""
        values = self.engine.values(theta)
        return np.array([values[f"{body}.inertia"] for body in self.engine.model.bodies])

    def gain(self, theta: Array) -> float:
        """Force of the drive per input, its size, above 0."""
        return max(abs(self.engine.values(theta)["drive.gain"]), 1e-300)

    def slope(self, theta: Array, shift: float) -> Array:
        """How far the driven body's balance in every window depends on the command, at least 0 [force per input].

        A density of the force that is left over is one of the recorded command times this: what switches the command
        off, a saturation, a long lag or a friction that takes what the drive gives, explains nothing of it.

        Parameters
        ----------
        theta, shift
            As of `residual`.

        Returns
        -------
        array, shape (rows,)
        """
        balance, values, timing = self._at(theta, shift)
        return balance.slope(values, timing, self.rest_speed)

    def drives(self, theta: Array, shift: float, least: float) -> tuple[float, Array]:
        """How much the drive's force changes for what the command changes: over all windows, and in each.

        Parameters
        ----------
        theta, shift
            As of `residual`.
        least : float
            A window counts for all where the drive passes on so much there, and less in proportion [force per input].

        Returns
        -------
        overall : float
            Standard deviation of the force over that of the command, above 0 [force per input].
        each : array, shape (rows,)
            Slope, at least 0 [force per input].
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
        """Part of every window in which the driven body stands and a friction holds it, shape (rows,)."""
        first = self.engine.model.bodies[0]
        held = any(one.at == first and one.effect.friction is not None for one in self.engine.model.effects)
        return self._slow if held else np.zeros(len(self.inertial))

    @cached_property
    def _slow(self) -> Array:
        """Part of every window in which the driven body counts as standing, shape (rows,)."""
        return self._along.weak((np.abs(self._along.whole.velocity[:, 0]) < self.rest_speed).astype(float))

    @cached_property
    def _beside_inertia(self) -> Array:
        """What else moves the driven body of the plainest machine, whatever the model: velocity, direction, a constant.

        Shape (rows, 3).
        """
        velocity = self._along.whole.velocity[:, 0]
        series = (velocity, np.sign(velocity), np.ones_like(velocity))
        return np.column_stack([self._along.weak(values) for values in series])

    @cached_property
    def motion_per_input(self) -> Array:
        """Log of how dense accelerations like a window's are among all, against commands like its own, shape (rows,).

        A window counts in full: p(command | motion) p(motion) or p(motion | command) p(command). By this the second is
        denser than the first where both see alike [log of input/(position/s²)].
        """
        acceleration, command = self.inertial[:, 0], self._along.weak_command
        return log_density(acceleration, scale_of(acceleration)) - log_density(command, scale_of(command))

    @cached_property
    def reliability(self) -> float:
        """Part of the driven body's weak acceleration that is no sensor noise, as power, at most 1.

        Of what its velocity does not tell already. By this ratio least squares of the force find too small an inertia
        (Fuller, *Measurement Error Models*, 1987).
        """
        acceleration = self.inertial[:, 0]
        coefficients = np.linalg.lstsq(self._beside_inertia, acceleration, rcond=None)[0]
        left = float(np.var(acceleration - self._beside_inertia @ coefficients))
        return 1.0 - float(self.noise[0]) ** 2 / max(left, 1e-300)

    @property
    def disagreement(self) -> float:
        """Largest difference of two sensors' velocities of one body, over the velocity; 0 within their noise."""
        return max(track.disagreement for track in self.tracks)

    @property
    def left_out(self) -> float:
        """What sensors see of the motion and these windows leave out, over their noise; the most of all bodies."""
        left, noise = np.sum([track.left_out for track in self.tracks], axis=0)
        return float(np.sqrt(np.max(left / np.maximum(noise, 1e-300))))

    @cached_property
    def widest(self) -> int:
        """Samples in the widest windows that still resolve the motion: about a period of four times its band."""
        motions = [measured_motion(self.engine.model, one) for one in self.data]
        band = max(motion.comparison_band for motion in motions if motion is not None)
        return max(round(1.0 / (band * self.sample_time)), NARROWEST)

    def drive(self, theta: Array, shift: float) -> Array:
        """Force of the drive in every window, as commanded.

        Parameters
        ----------
        theta, shift
            As of `residual`.

        Returns
        -------
        array, shape (rows,)
        """
        balance, values, timing = self._at(theta, shift)
        return balance.drives(values, timing)[0]

    def along(self, what: str, body: int = 0) -> Array:
        """A signal at every window's middle: ``time``, ``command``, or ``position`` or ``velocity`` of a body."""
        found = []
        for track in self.tracks:
            m = track.motion
            series = {"time": m.time, "position": m.position[:, body], "velocity": m.velocity[:, body]}
            values = _command([track], 0.0).mean if what == "command" else series[what]
            found.append(values[track.rows + self.width // 2])
        return np.concatenate(found)


def _instants(track: Track) -> Instants:
    motion = track.motion
    # Of one layout in memory, for which the balance is compiled.
    time, position, velocity, acceleration = (
        np.ascontiguousarray(part) for part in (motion.time, motion.position, motion.velocity, motion.acceleration)
    )
    return Instants(time, position, velocity, acceleration, track.conditions)


def _deviation(values: Array, weights: Array) -> float:
    """Standard deviation of weighted values."""
    total = max(float(np.sum(weights)), 1e-300)
    mean = float(np.sum(weights * values)) / total
    return float(np.sqrt(np.sum(weights * (values - mean) ** 2) / total))


def weak_form(engine: Engine, data: Sequence[Data], width: int, rest_speed: float | None = None) -> WeakForm | None:
    """The weak form of some records.

    Parameters
    ----------
    engine : Engine
    data : sequence of Data
    width : int
        Samples in a window.
    rest_speed : float, optional
        As of `WeakForm`.

    Returns
    -------
    WeakForm or None
        None where some body is not measured, or a record has too few samples.
    """
    tracks = []
    for one in data:
        track = track_of(engine, one, width)
        if track is None or not len(track.rows):
            return None
        tracks.append(track)
    return WeakForm(engine, data, tracks, width, rest_speed)
