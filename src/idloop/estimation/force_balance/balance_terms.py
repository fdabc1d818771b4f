"""Terms of a force balance along a measured motion, each cached while its own parameters are constant.

Along a measured motion the forces of a model are independent terms: inertia, springs, the drive, each effect at a body,
the dry friction of each body. A fit moves one parameter at a time, and candidate models share all effects but one, so
that an evaluation needs at most one new term. Only a body at rest couples them: its dry friction balances the others.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csr_array

from idloop.estimation.force_balance.held_command import CommandAround
from idloop.physics import kernel
from idloop.physics.conditions import Conditions
from idloop.physics.effect import BODY, COUPLING, INPUT, Effect
from idloop.physics.layout import Layout, lay_out
from idloop.physics.model import ActiveEffect, Model, values_of

Array = NDArray[np.float64]
Places = NDArray[np.int64]
Values = Mapping[str, float]

# Size of the cache [bytes], and the least number of terms in it.
_CACHE_BYTES, _FEWEST_CACHED = 32_000_000, 16
# Change of the command, as a part of its rms, for the response of the balance to it.
PROBE = 1e-3
# Indices of the arguments by which a friction or a force depends on other terms: the transmitted torque, the inertia.
_ARRIVING = _INERTIA = 2
# Part of a sample time below which a body does not count as turned.
_LEAST_TURNED = 1e-3
# Speed of a body that barely moves [m/s or rad/s].
_BARELY = 1e-9
# Parts of a sample time at which commands are averaged; between them, means change nearly by a line.
_PARTS = 16
# Rounds in which the start of an integral and the friction that it causes agree.
_STARTS = 4
_NO_JUMPS = np.zeros(0, dtype=np.int64)


def halfway(time: Array) -> Array:
    """Instants between each and the one before: from there on the mean command around it acts."""
    return np.append(time[:1], 0.5 * (time[:-1] + time[1:]))


@dataclass(frozen=True)
class Instants:
    """Motion (m, bodies) of all bodies at m successive instants, and the measured conditions.

    ``turned`` (m, bodies) is the part of the sample time in which a body moves the other way.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    conditions: Conditions | None
    turned: Array

    def at(self, places: Places) -> Instants:
        """The motion at some instants in any order, as if they were successive."""
        before, time = self.time[places], np.arange(len(places), dtype=float)
        conditions = None if self.conditions is None else self.conditions.sampled(before, time)
        position, velocity, acceleration = self.position[places], self.velocity[places], self.acceleration[places]
        return Instants(time, position, velocity, acceleration, conditions, self.turned[places])


@dataclass(frozen=True)
class Term:
    """One force along a motion.

    Attributes
    ----------
    weak : array, shape (rows,)
        Weighted mean over every window.
    near : array, shape (k,)
        Values at the instants near rest.
    """

    weak: Array
    near: Array

    @property
    def nbytes(self) -> int:
        """Memory in bytes."""
        return self.weak.nbytes + self.near.nbytes

    def __mul__(self, factor: float) -> Term:
        return Term(factor * self.weak, factor * self.near)


@dataclass(frozen=True)
class DriveTerm:
    """Force of the drive along a motion, per gain, on both sides of the jumps of the command near rest.

    Attributes
    ----------
    weak : array, shape (rows,)
        As of `Term`.
    near : array, shape (k + 2 j,)
        At k instants near rest, then before and after j jumps among them.
    jumps : array of int, shape (j,)
        Indices of the jumps among the k instants.
    late : array, shape (j,)
        Part of the sample time after the jump.
    probe : callable
        Changes of both by small changes of the command.
    sent : array, shape (rows,)
        Rms of these changes of the command in every window.
    """

    weak: Array
    near: Array
    jumps: Places
    late: Array
    probe: Callable[[], list[tuple[Array, Array]]]
    sent: Array

    @property
    def nbytes(self) -> int:
        """Memory in bytes."""
        return 3 * (self.weak.nbytes + self.near.nbytes)

    @cached_property
    def changes(self) -> list[tuple[Array, Array]]:
        """Result of `probe`."""
        return self.probe()

    @cached_property
    def mean(self) -> Array:
        """Mean of both sides at the instants near rest, shape (k,)."""
        return np.asarray(mean_of_sides(self.near, len(self.near) - 2 * len(self.jumps), self.jumps, self.late))

    def __mul__(self, gain: float) -> DriveTerm:
        def probe() -> list[tuple[Array, Array]]:
            return [(gain * weak, gain * near) for weak, near in self.changes]

        return DriveTerm(gain * self.weak, gain * self.near, self.jumps, self.late, probe, self.sent)

    def response(self, changed: Callable[[Array, Array], Array]) -> Array:
        """Derivative by the command, in every window (rows,), of a function of the changes of the drive."""
        squares = sum(changed(weak, near) ** 2 for weak, near in self.changes)
        return np.asarray(np.sqrt(squares / np.maximum(self.sent**2, 1e-300)))


@dataclass(frozen=True)
class _Friction:
    """Dry friction of a body: as a term while it moves, and the breakaway levels in both directions."""

    weak: Array
    near: Array
    ahead: Array
    back: Array

    @property
    def nbytes(self) -> int:
        """Memory in bytes."""
        return self.weak.nbytes + 3 * self.near.nbytes

    def __mul__(self, factor: float) -> _Friction:
        return _Friction(factor * self.weak, factor * self.near, factor * self.ahead, factor * self.back)


@njit(cache=True, nogil=True)
def mean_of_sides(values: Array, count: int, jumps: Places, late: Array) -> Array:
    """Values at instants from values there, then before and after the jumps: weighted means of both sides."""
    found: Array = values[:count].copy()
    for k in range(len(jumps)):
        found[jumps[k]] = (1.0 - late[k]) * values[count + k] + late[k] * values[count + len(jumps) + k]
    return found


# Sums may be reordered, so that they are computed several terms at a time.
@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def windowed(values: Array, rows: Places, weights: Array) -> Array:
    """Weighted sums of the columns of values (n, b) over the windows that begin at some rows."""
    sums = np.empty((len(rows), values.shape[1]))
    for column in range(values.shape[1]):
        signal = np.ascontiguousarray(values[:, column])
        for row in range(len(rows)):
            total, first = 0.0, rows[row]
            for k in range(len(weights)):
                total += weights[k] * signal[first + k]
            sums[row, column] = total
    return sums


@njit(cache=True, nogil=True, error_model="numpy")
def _with_friction(left: float, speed: float, rest: float, moving: float, ahead: float, back: float) -> float:
    """Change of the unexplained force ``left`` of a body at one instant by its dry friction."""
    if speed > rest:
        return moving
    if left > 0.0:
        return max(left - back, 0.0) - left
    return -max(-left - ahead, 0.0) - left


@njit(cache=True, nogil=True, error_model="numpy")
def _change_by_friction(
    left: Array, speed: Array, rest: float, friction: tuple[Array, Array, Array], drive: Array, mean: Array,
    jumps: Places, late: Array,
) -> Array:  # fmt: skip
    """Change of the unexplained force ``left`` (k,) of a body near rest by its dry friction, shape (k,).

    At a jump of the command a body may be at rest before and not after: ``drive`` (k + 2 j,) is the force on both
    sides, ``mean`` (k,) the one in ``left``.
    """
    moving, ahead, back = friction
    change = np.empty(len(left))
    for k in range(len(left)):
        change[k] = _with_friction(left[k], speed[k], rest, moving[k], ahead[k], back[k])
    for place in range(len(jumps)):
        k, total = jumps[place], 0.0
        for side in range(2):
            there = left[k] + mean[k] - drive[len(left) + side * len(jumps) + place]
            share = late[place] if side else 1.0 - late[place]
            total += share * _with_friction(there, speed[k], rest, moving[k], ahead[k], back[k])
        change[k] = total
    return change


@njit(cache=True, nogil=True)
def _in_windows(first: Places, columns: Places, weights: Array, values: Array) -> Array:
    """Product of a sparse matrix by rows and a vector, shape (rows,)."""
    sums = np.zeros(len(first) - 1)
    for row in range(len(sums)):
        for entry in range(first[row], first[row + 1]):
            sums[row] += weights[entry] * values[columns[entry]]
    return sums


@dataclass(frozen=True)
class _Turned:
    """Instants in whose sample time a body moves both ways: at ``places``, the other way by the ``share`` (k,) of it.

    The ``motions`` are those in which it barely moves as it does at the instant, and the other way.
    """

    places: Places
    share: Array
    motions: tuple[Instants, Instants]


class MotionInWindows:
    """The measured motion of records, windows over it, and a cache of the forces along it.

    Parameters
    ----------
    motions : sequence of Instants
        One for each segment of a record.
    commands : callable
        From a delay [s] to the commands around the instants of all segments.
    rows : array of int, shape (rows,)
        First sample of every window, of all segments in turn.
    weights : array, shape (width,)
        Of the samples of a window.
    inertial : array, shape (rows, bodies)
        Weak acceleration of every body.
    slowest : float
        Upper limit of the rest speed [m/s or rad/s].
    """

    def __init__(
        self, motions: Sequence[Instants], commands: Callable[[float], CommandAround], rows: Places, weights: Array,
        inertial: Array, slowest: float,
    ) -> None:  # fmt: skip
        self.motions, self.commands, self.rows, self.weights = tuple(motions), commands, rows, weights
        self.inertial = inertial
        self.whole = _joined(self.motions)
        self.sample_time = float(np.median(np.diff(self.whole.time[:100])))
        mean = commands(0.0).mean
        self.command_rms = float(np.sqrt(np.mean(mean**2)))
        self.weak_command = self.weak(mean)
        self.near = np.flatnonzero(np.any(np.abs(self.whole.velocity) <= slowest, axis=1))
        # Of every body, at the instants near rest.
        self.speed = np.ascontiguousarray(np.abs(self.whole.velocity[self.near]).T)
        self.near_rest = self.whole.at(self.near)
        # Index of every instant among those near rest, -1 for others.
        self.place = np.full(len(self.whole.time), -1)
        self.place[self.near] = np.arange(len(self.near))
        self._cache: OrderedDict[Any, tuple[Any, int]] = OrderedDict()
        self._size, self._lock = 0, Lock()
        self._most = max(_CACHE_BYTES, _FEWEST_CACHED * 8 * (len(rows) + len(self.near)))

    def constants(self, force: Array) -> Array:
        """Mean of a force (rows,) over the windows of each motion in which all bodies move, shape (motions,)."""
        found = np.zeros(len(self.motions))
        for number in range(len(found)):
            own = self._motion_of_window == number
            moving = own & (np.diff(self._near_matrix.indptr) == 0)
            found[number] = np.mean(force[moving if np.any(moving) else own])
        return found

    def each(self, constants: Array) -> tuple[Array, Array]:
        """A constant of each motion (motions,) in every window (rows,), and at the instants near rest (k,)."""
        counts = [len(motion.time) for motion in self.motions]
        return constants[self._motion_of_window], np.repeat(constants, counts)[self.near]

    @cached_property
    def _motion_of_window(self) -> Places:
        ends = np.cumsum([len(motion.time) for motion in self.motions])
        return np.searchsorted(ends, self.rows, side="right")

    @cached_property
    def turned(self) -> list[_Turned]:
        """Of every body."""
        found = []
        for body, share in enumerate(self.whole.turned.T):
            places = np.flatnonzero(share > _LEAST_TURNED)
            there = self.whole.at(places)
            speeds = np.zeros((2, *there.velocity.shape)) + there.velocity
            speeds[:, :, body] = np.copysign(_BARELY, speeds[:, :, body]) * [[1.0], [-1.0]]
            found.append(
                _Turned(places, share[places], (replace(there, velocity=speeds[0]), replace(there, velocity=speeds[1])))
            )
        return found

    def pieces(self, *, memory: bool) -> Sequence[Instants]:
        """The motions one by one for a force with memory, else all at once."""
        return self.motions if memory else (self.whole,)

    def weak(self, values: Array) -> Array:
        """Mean of signals (m,) or (m, k) over every window, shape (rows,) or (rows, k)."""
        columns = np.ascontiguousarray(values if values.ndim == 2 else values[:, None])
        means = np.asarray(windowed(columns, self.rows, self.weights))
        return means if values.ndim == 2 else means[:, 0]

    def near_in_windows(self, values: Array) -> Array:
        """Part of the window means, shape (rows,), by values (k,) at the instants near rest."""
        matrix = self._near_matrix
        return np.asarray(_in_windows(matrix.indptr, matrix.indices, matrix.data, values))

    @cached_property
    def _near_matrix(self) -> Any:
        """Sparse matrix (rows, k) of `near_in_windows`."""
        width = len(self.weights)
        row, offset = np.divmod(np.arange(len(self.rows) * width), width)
        column = self.place[self.rows[row] + offset]
        there = column >= 0
        shape = (len(self.rows), len(self.near))
        return csr_array((self.weights[offset[there]], (row[there], column[there])), shape=shape)

    @cached_property
    def constant_change(self) -> tuple[list[Array], Array]:
        """A small constant change of the command (m,), and its rms in every window (rows,)."""
        probe = PROBE * self.command_rms
        return [np.full(len(self.whole.time), probe)], np.full(len(self.rows), probe)

    @cached_property
    def square_waves(self) -> tuple[list[Array], Array]:
        """Two small square waves of the command, a quarter of a period apart, and their rms in every window (rows,).

        For the response of a lag, which does not pass fast changes.
        """
        probe = PROBE * self.command_rms
        counts = [np.arange(len(motion.time)) / len(self.weights) for motion in self.motions]
        waves = [
            np.concatenate([np.where((count + late) % 2.0 < 1.0, probe, -probe) for count in counts])
            for late in (0.0, 0.5)
        ]
        return waves, np.asarray(np.sqrt(sum(self.weak(wave) ** 2 for wave in waves)))

    @cached_property
    def weak_velocity(self) -> Array:
        """Velocity of every body in every window, shape (rows, bodies)."""
        return np.asarray(windowed(self.whole.velocity, self.rows, self.weights))

    @cached_property
    def weak_position(self) -> Array:
        """Position of every body in every window, shape (rows, bodies)."""
        return np.asarray(windowed(self.whole.position, self.rows, self.weights))

    def cached(self, key: Any, made: Callable[[], Any]) -> Any:
        """Value of a key from the cache, or made now."""
        with self._lock:
            if key in self._cache:
                self._cache.move_to_end(key)
                return self._cache[key][0]
        found = made()
        size = int(getattr(found, "nbytes", 0))
        with self._lock:
            if key not in self._cache:
                self._cache[key] = found, size
                self._size += size
            while self._size > self._most and len(self._cache) > 1:
                self._size -= self._cache.popitem(last=False)[1][1]
        return found

    def term(self, values: Array) -> Term:
        """A force given at all instants."""
        return Term(self.weak(values), values[self.near])


def _joined(motions: Sequence[Instants]) -> Instants:
    """Several motions, concatenated."""
    step = float(np.median(np.diff(motions[0].time[:100])))
    times, conditions, after = [], [], 0.0
    for motion in motions:
        times.append(motion.time - motion.time[0] + after)
        if motion.conditions is not None:
            conditions.append(motion.conditions.sampled(motion.time, times[-1]))
        after = float(times[-1][-1]) + step
    return Instants(
        np.concatenate(times),
        np.concatenate([motion.position for motion in motions]),
        np.concatenate([motion.velocity for motion in motions]),
        np.concatenate([motion.acceleration for motion in motions]),
        Conditions.joined(conditions) if len(conditions) == len(motions) else None,
        np.concatenate([motion.turned for motion in motions]),
    )


class _CommandPlaces:
    """Where the commands around all instants act: at the instants, then on both sides of every jump."""

    def __init__(self, along: MotionInWindows, around: CommandAround) -> None:
        self._along = along
        self.instants = np.concatenate([np.arange(len(around.mean)), around.jumps, around.jumps])
        place = along.place[around.jumps]
        self.kept = np.flatnonzero(place >= 0)  # jumps near rest
        self.jumps = place[self.kept]  # their indices among the instants near rest
        sides = len(around.mean) + self.kept
        self.near = np.concatenate([along.near, sides, sides + len(around.jumps)])

    @cached_property
    def driven(self) -> tuple[Array, Array, Array, Conditions | None]:
        """Successive times, position and velocity of the driven body at every command (n,), and the conditions."""
        whole, time = self._along.whole, np.arange(len(self.instants), dtype=float)
        conditions = None if whole.conditions is None else whole.conditions.sampled(whole.time[self.instants], time)
        return time, whole.position[self.instants, 0], whole.velocity[self.instants, 0], conditions


class _Commands:
    """Commands around all instants at some delay: the means, then both sides of every jump."""

    def __init__(self, along: MotionInWindows, around: CommandAround, places: _CommandPlaces) -> None:
        self._along, self.around, self.places = along, around, places
        self.command = np.concatenate([around.mean, around.before, around.after])

    @classmethod
    def at(cls, along: MotionInWindows, timing: float) -> _Commands:
        """Those at a delay [s]: on the line between the nearest ones, at parts of the sample time."""
        part = along.sample_time / _PARTS
        node = math.floor(timing / part)
        share = timing / part - node

        def made(node: int) -> _Commands:
            around = along.commands(node * part)
            return cls(along, around, _CommandPlaces(along, around))

        def known(node: int) -> _Commands:
            found: _Commands = along.cached(("commands", node), lambda: made(node))
            return found

        return known(node) if share == 0.0 else known(node).towards(known(node + 1), share)

    def towards(self, other: _Commands, share: float) -> _Commands:
        """Commands on the line to those at another delay, with the jumps of these."""
        here = self.around
        mean = here.mean + share * (other.around.mean - here.mean)
        late = (mean[here.jumps] - here.before) / (here.after - here.before)
        return _Commands(self._along, replace(here, mean=mean, late=np.clip(late, 0.0, 1.0)), self.places)

    @property
    def late(self) -> Array:
        """Part of the sample time after each of the jumps near rest."""
        return self.around.late[self.places.kept]

    @property
    def nbytes(self) -> int:
        """Memory in bytes."""
        return 9 * int(self.command.nbytes)

    def both(self, force: Array) -> tuple[Array, Array]:
        """A force at these commands in every window, and near rest."""
        around = self.around
        mean = mean_of_sides(force, len(around.mean), around.jumps, around.late)
        return self._along.weak(mean), force[self.places.near]


def _numbers(active: ActiveEffect, values: Values) -> tuple[float, ...]:
    return tuple(values_of(active, values).values())


def _identity(effect: Effect) -> tuple[str, str, int]:
    """Key of an effect among those of all catalogues."""
    return effect.name, effect.site, id(effect)


@dataclass(frozen=True)
class _Unexplained:
    """Unexplained force in every window, shape (rows, bodies), and of what it is made at the driven body.

    Attributes
    ----------
    weak : array, shape (rows, bodies)
    near : array, shape (k,)
        At the instants near rest, without dry friction.
    drive : DriveTerm
    change : array, shape (k,)
        By the dry friction.
    """

    weak: Array
    near: Array
    drive: DriveTerm
    change: Array


class BalanceTerms:
    """Unexplained force of a model along a measured motion, term by term.

    Parameters
    ----------
    model : Model
        All of its bodies are measured.
    along : MotionInWindows
    """

    def __init__(self, model: Model, along: MotionInWindows) -> None:
        self.model, self.along = model, along
        effects = [one for one in model.acting if not one.effect.splits]
        self.inputs = [one for one in effects if one.effect.site == INPUT]
        self._forces = [one for one in effects if one.effect.site == BODY and one.effect.force is not None]
        self._place = {body: index for index, body in enumerate(model.bodies)}
        dry = [one for one in effects if one.effect.friction is not None]
        self._dry = {
            index: several for body, index in self._place.items() if (several := [one for one in dry if one.at == body])
        }
        self._coupled = {
            joint: several
            for joint, coupling in enumerate(model.couplings)
            if (several := [one for one in effects if one.effect.site == COUPLING and one.at == coupling])
        }
        self._lags = any(one.effect.settle is not None for one in self.inputs)
        self._undistorted = not any(one.effect.command is not None for one in self.inputs)
        self._inertias = [f"{body}.inertia" for body in model.bodies]
        self._viscous = [f"{body}.viscous_friction" for body in model.bodies]
        self._last: tuple[tuple[float, ...], _Unexplained] | None = None

    def residual(self, values: Values, timing: float, rest: float) -> Array:
        """Unexplained force of every window, shape (rows, bodies): inertial force minus all modelled forces.

        Parameters
        ----------
        values : mapping
            Values of all parameters.
        timing : float
            Delay of the command [s].
        rest : float
            Speed below which a body counts as at rest [m/s or rad/s].
        """
        return self._at_rest_too(values, timing, rest).weak

    def slope(self, values: Values, timing: float, rest: float) -> Array:
        """Derivative of the driven body's balance by the command in every window, shape (rows,) [force per input]."""
        if 0 not in self._dry:
            return self._drive(values, timing).response(lambda weak, near: weak)
        found = self._at_rest_too(values, timing, rest)
        drive, friction = found.drive, self._friction(0, values)

        def changed(weak: Array, near: Array) -> Array:
            other = self._change(0, friction, found.near, drive, rest, near)
            return np.asarray(self.along.near_in_windows(other - found.change) - weak)

        return drive.response(changed)

    def _at_rest_too(self, values: Values, timing: float, rest: float) -> _Unexplained:
        """What the forces leave, with the dry friction of bodies at rest; the last one is kept."""
        key = (*values.values(), timing, rest)
        if self._last is None or self._last[0] != key:
            weak, near, drive = self._left(values, timing)
            if self.model.integrates:
                # Where an integral in the drive starts is not measured: what it adds holds a body at rest as well.
                sliding = self._friction(0, values).weak if 0 in self._dry else 0.0
                started = self.along.each(self.along.constants(weak[:, 0] + sliding))
                weak[:, 0] -= started[0]
                near[:, 0] -= started[1]
            change = np.zeros(0)
            for body in self._dry:
                friction = self._friction(body, values)
                own = self._change(body, friction, near[:, body], drive if body == 0 else None, rest)
                weak[:, body] += friction.weak + self.along.near_in_windows(own)
                change = own if body == 0 else change
            self._last = key, _Unexplained(weak, np.ascontiguousarray(near[:, 0]), drive, change)
        return self._last[1]

    def drives(self, values: Values, timing: float) -> tuple[Array, Array]:
        """Force of the drive in every window, and its derivative by the command, each of shape (rows,)."""
        drive = self._drive(values, timing)
        return drive.weak, drive.response(lambda weak, near: weak)

    def _left(self, values: Values, timing: float) -> tuple[Array, Array, DriveTerm]:
        """Unexplained force without dry friction, in every window and near rest, and the drive."""
        along = self.along
        inertia = np.array([values[name] for name in self._inertias])
        viscous = np.array([values[name] for name in self._viscous])
        weak = inertia * along.inertial + viscous * along.weak_velocity
        near = inertia * along.near_rest.acceleration + viscous * along.near_rest.velocity
        drive = self._drive(values, timing)
        weak[:, 0] -= drive.weak
        near[:, 0] -= drive.mean
        for active in self._forces:
            force, body = self._force(active, values), self._place[active.at]
            weak[:, body] -= force.weak
            near[:, body] -= force.near
        for joint, coupling in enumerate(self.model.couplings):
            torque = self._torque(joint, coupling, values)
            for body, sign in ((joint, 1.0), (joint + 1, -1.0)):
                weak[:, body] += sign * torque.weak
                near[:, body] += sign * torque.near
        return weak, near, drive

    def _change(
        self, body: int, friction: _Friction, left: Array, drive: DriveTerm | None, rest: float,
        changed: Array | None = None,
    ) -> Array:  # fmt: skip
        """Change of the unexplained force of a body near rest by its dry friction, shape (k,)."""
        levels = (friction.near, friction.ahead, friction.back)
        left, speed = np.ascontiguousarray(left), self.along.speed[body]
        if drive is None:
            none = np.zeros(0)
            return np.asarray(_change_by_friction(left, speed, rest, levels, none, none, _NO_JUMPS, none))
        near, mean = drive.near, drive.mean
        if changed is not None:
            shift = mean_of_sides(changed, len(left), drive.jumps, drive.late)
            left, near, mean = left - shift, near + changed, mean + shift
        return np.asarray(_change_by_friction(left, speed, rest, levels, near, mean, drive.jumps, drive.late))

    def _alone(
        self, kept: Sequence[ActiveEffect], values: Values, gain: float = 0.0, chain: int | None = None
    ) -> Layout:
        """The compiled model with some effects only, a gain of the drive, and at most one coupling of the chain."""

        def made() -> Layout:
            others = [one.name for one in self.model.effects if one not in kept]
            loop = self.model.loop if self.model.loop in kept else None
            return lay_out(replace(self.model.without_effects(others), loop=loop), final=False)

        key = (
            "layout",
            self.model.bodies,
            self.model.couplings,
            tuple((*_identity(one.effect), one.at) for one in kept),
        )
        layout: Layout = self.along.cached(key, made)
        constants, only = layout.axis.constants.copy(), np.zeros(len(layout.axis.stiffness))
        constants[kernel.GAIN], constants[kernel.DELAY] = gain, 0.0
        if chain is not None:
            only[chain] = 1.0
        stiffness, damping = (
            only * np.array([values[f"{one}.{own}"] for one in self.model.couplings])
            for own in ("stiffness", "damping")
        )
        numbers = [number for one in kept if not one.effect.delay for number in _numbers(one, values)]
        axis = layout.axis._replace(
            constants=constants, viscous=np.zeros(layout.bodies), stiffness=stiffness, damping=damping,
            inertia=np.array([values[name] for name in self._inertias]), parameters=np.array([*numbers, 0.0]),
        )  # fmt: skip
        return replace(layout, axis=axis)

    def _balance(self, layout: Layout, motions: Sequence[Instants], commands: Sequence[Array] | None = None) -> Array:
        """Minus all forces of a compiled model at the instants of motions, shape (m, bodies)."""
        found = []
        for index, motion in enumerate(motions):
            count = len(motion.time)
            left, required = np.empty((count, layout.bodies)), np.empty(count)
            command = np.zeros(count) if commands is None else np.ascontiguousarray(commands[index])
            kernel.balance(
                layout.under(motion.conditions).axis, motion.time, motion.position, motion.velocity,
                np.zeros_like(motion.velocity), halfway(motion.time), command, -1.0, layout.new_state(), left, required,
            )  # fmt: skip
            found.append(left)
        return np.concatenate(found)

    def _force(self, active: ActiveEffect, values: Values) -> Term:
        """Force of an effect at a body."""
        numbers, size = _numbers(active, values), 1.0
        if active.effect.proportional:
            size, numbers = numbers[0], (1.0, *numbers[1:])
            if size == 0.0:
                return Term(np.zeros(len(self.along.rows)), np.zeros(len(self.along.near)))

        def made() -> Term:
            strength = {f"{active.name}.{active.effect.parameters[0].name}": numbers[0]} if numbers else {}
            layout, body = self._alone([active], {**values, **strength}), self._place[active.at]
            if active.effect.settle is not None:
                return self.along.term(-self._balance(layout, self.along.motions)[:, body])
            return self.along.term(_body_force(layout, self.along.whole, body))

        hooks = (active.effect.force, active.effect.settle)
        inertia = (
            values[f"{active.at}.inertia"] if any(one is not None and one.arguments[_INERTIA] for one in hooks) else 0.0
        )
        found: Term = self.along.cached((_identity(active.effect), self._place[active.at], numbers, inertia), made)
        return found * size if size != 1.0 else found

    def _torque(self, joint: int, coupling: str, values: Values) -> Term:
        """Torque of a coupling between a body and the next."""
        along, several = self.along, self._coupled.get(joint, [])
        stiffness, damping = values[f"{coupling}.stiffness"], values[f"{coupling}.damping"]
        if not several:
            weak = [q[:, joint] - q[:, joint + 1] for q in (along.weak_position, along.weak_velocity)]
            near = [q[:, joint] - q[:, joint + 1] for q in (along.near_rest.position, along.near_rest.velocity)]
            return Term(stiffness * weak[0] + damping * weak[1], stiffness * near[0] + damping * near[1])

        def made() -> Term:
            layout = self._alone(several, values, chain=joint)
            memory = any(one.effect.settle is not None for one in several)
            return along.term(self._balance(layout, along.pieces(memory=memory))[:, joint])

        numbers = tuple((_identity(one.effect), *_numbers(one, values)) for one in several)
        found: Term = along.cached((joint, stiffness, damping, numbers), made)
        return found

    def _friction(self, body: int, values: Values) -> _Friction:
        """Dry friction of a body."""
        several, size = self._dry[body], 1.0
        numbers = [_numbers(one, values) for one in several]
        if len(several) == 1 and several[0].effect.proportional and numbers[0][0] >= 0.0:
            size, numbers[0] = numbers[0][0], (1.0, *numbers[0][1:])

        def made() -> _Friction:
            strength = {f"{several[0].name}.{several[0].effect.parameters[0].name}": numbers[0][0]}
            layout, along = self._alone(several, {**values, **strength}), self.along
            moving, turned = _moving_friction(layout, along.whole, body), along.turned[body]
            here, back = (_moving_friction(layout, motion, body) for motion in turned.motions)
            moving[turned.places] += turned.share * (back - here)
            slow = moving[along.near]
            moving[along.near] = 0.0
            ahead, back = (_friction_level(layout, along.near_rest, body, sign, 0.0) for sign in (1.0, -1.0))
            return _Friction(along.weak(moving), slow, ahead, back)

        keys = tuple((_identity(one.effect), *own) for one, own in zip(several, numbers, strict=True))
        found: _Friction = self.along.cached(("friction", body, keys), made)
        return found * size if size != 1.0 else found

    def _drive(self, values: Values, timing: float) -> DriveTerm:
        """The drive and the effects at its input, with its gain."""
        numbers = tuple((_identity(one.effect), *_numbers(one, values)) for one in self.inputs)
        found: DriveTerm = self.along.cached(("drive", timing, numbers), lambda: self._drive_per_gain(values, timing))
        return found * values["drive.gain"]

    def _drive_per_gain(self, values: Values, timing: float) -> DriveTerm:
        along = self.along
        commands = _Commands.at(along, timing)
        waves, sent = along.square_waves if self._lags else along.constant_change
        if self._lags:
            # An effect with memory is evaluated for one command per sample, not for both sides of a jump.
            given, jumps, late = commands.around.mean, commands.places.jumps[:0], commands.late[:0]
        else:
            given, jumps, late = commands.command, commands.places.jumps, commands.late
        force = self._drive_force(values, commands)
        base = force(given)

        def changes() -> list[tuple[Array, Array]]:
            if self._undistorted and not self._lags:
                return [(sent, np.full(len(commands.places.near), waves[0][0]))]
            given_waves = waves if self._lags else [wave[commands.places.instants] for wave in waves]
            return [evaluated(force(given + wave) - base) for wave in given_waves]

        def evaluated(force: Array) -> tuple[Array, Array]:
            return (along.weak(force), force[along.near]) if self._lags else commands.both(force)

        return DriveTerm(*evaluated(base), jumps, late, changes, sent)

    def _drive_force(self, values: Values, commands: _Commands) -> Callable[[Array], Array]:
        """Function from commands to the force of the drive, per gain."""
        along, values = self.along, {**values, "drive.gain": 1.0}
        if self._lags:
            starts = np.cumsum([len(motion.time) for motion in along.motions])[:-1]
            lagging = self._alone(self.inputs, values, gain=1.0)
            return lambda command: -self._balance(lagging, along.motions, np.split(command, starts))[:, 0]
        if self._undistorted:
            return lambda command: command
        time, position, velocity, conditions = commands.places.driven
        drive = self._alone(self.inputs, values, gain=1.0).under(conditions)

        def force(command: Array) -> Array:
            given = np.empty(len(command))
            kernel.drive_along(drive.axis, time, command, position, velocity, drive.new_state(), given)
            return given

        return force


class WholeBalance(BalanceTerms):
    """Unexplained force of a model whose terms depend on each other, as with load-dependent friction."""

    @property
    def _remembers(self) -> bool:
        return any(one.effect.settle is not None for one in self.model.acting)

    def residual(self, values: Values, timing: float, rest: float) -> Array:
        """As of `BalanceTerms`."""
        return self._whole(values, timing, rest, self._started(values, timing))

    def slope(self, values: Values, timing: float, rest: float) -> Array:
        """As of `BalanceTerms`."""
        started = self._started(values, timing)
        base = self._whole(values, timing, rest, started)[:, 0]
        waves, sent = self.along.square_waves if self._lags else self.along.constant_change
        squares = sum((self._whole(values, timing, rest, started, wave)[:, 0] - base) ** 2 for wave in waves)
        return np.asarray(np.sqrt(squares / np.maximum(sent**2, 1e-300)))

    def _started(self, values: Values, timing: float) -> Array:
        """Force of an integral in the drive at the start of each motion, by which friction differs too (motions,)."""
        found = np.zeros(len(self.along.motions))
        if self.model.integrates and values["drive.integral"] * values["drive.gain"] != 0.0:
            for _ in range(_STARTS):
                found += self.along.constants(self._whole(values, timing, -1.0, found)[:, 0])
        return found

    def _whole(self, values: Values, timing: float, rest: float, started: Array, wave: Array | None = None) -> Array:
        along = self.along
        around = _Commands.at(along, timing).around
        added = np.zeros(len(around.mean)) if wave is None else wave
        layout = lay_out(self.model, values, final=False)
        constants = layout.axis.constants.copy()
        constants[kernel.DELAY] = 0.0
        if self._remembers:
            ends = np.cumsum([len(motion.time) for motion in along.motions])[:-1]
            parts = zip(along.motions, np.split(around.mean + added, ends), started, strict=True)
            left = np.concatenate(
                [
                    _equation_error(layout, constants, motion, given, rest, self._state(layout, values, force))
                    for motion, given, force in parts
                ]
            )
        else:
            command = np.concatenate([around.mean, around.before, around.after])
            instants = np.concatenate([np.arange(len(around.mean)), around.jumps, around.jumps])
            error = _equation_error(layout, constants, along.whole.at(instants), command + added[instants], rest)
            sides = (len(around.mean), around.jumps, around.late)
            left = np.column_stack([mean_of_sides(column.copy(), *sides) for column in error.T])
        for body, turned in enumerate(along.turned):
            # An integral is known along the motion only, not at single instants.
            if body not in self._dry or self.model.integrates:
                continue
            given = (around.mean + added)[turned.places]
            here, back = (_equation_error(layout, constants, one, given, -1.0)[:, body] for one in turned.motions)
            moves = np.abs(along.whole.velocity[turned.places, body]) > rest
            left[turned.places, body] += moves * turned.share * (back - here)
        inertia = np.array([values[f"{body}.inertia"] for body in self.model.bodies])
        # The acceleration matters for a body at rest, whose friction balances all other forces.
        left = left - inertia * along.whole.acceleration
        return np.asarray(windowed(left, along.rows, along.weights) + inertia * along.inertial)

    def _state(self, layout: Any, values: Values, started: float) -> Array:
        """The state of a model in whose drive an integral starts with a force."""
        state: Array = layout.new_state()
        if started != 0.0:
            # The loop acts first, and its integral is its first state.
            place = kernel.FIRST + 3 * layout.bodies
            state[place] = started / (values["drive.integral"] * values["drive.gain"])
        return state


def _equation_error(
    layout: Any, constants: Array, motion: Instants, command: Array, rest: float, state: Array | None = None
) -> Array:
    axis = layout.under(motion.conditions).axis._replace(constants=constants)
    left, required = np.empty((len(command), layout.bodies)), np.empty(len(command))
    kernel.balance(
        axis, motion.time, motion.position, motion.velocity, motion.acceleration, halfway(motion.time), command, rest,
        layout.new_state() if state is None else state, left, required,
    )  # fmt: skip
    return left


def _body_force(layout: Layout, motion: Instants, body: int) -> Array:
    """Force of a compiled model's effects at a body along a motion, without dry friction, shape (m,)."""
    force, axis = np.empty(len(motion.time)), layout.under(motion.conditions).axis
    kernel.body_forces_along(axis, motion.time, motion.position, motion.velocity, body, layout.new_state(), force)
    return force


def _friction_level(
    layout: Layout, motion: Instants, body: int, direction: Array | float, speed: Array | float
) -> Array:
    """Level of a compiled model's dry friction at a body along a motion, shape (m,)."""
    count, axis = len(motion.time), layout.under(motion.conditions).axis
    level, (directions, speeds) = np.empty(count), (np.zeros(count) + each for each in (direction, speed))
    kernel.dry_friction_along(axis, motion.time, motion.position, directions, speeds, body, layout.new_state(), level)
    return level


def _moving_friction(layout: Layout, motion: Instants, body: int) -> Array:
    """Dry friction of a compiled model at a body that moves, shape (m,)."""
    velocity = motion.velocity[:, body]
    direction = np.where(velocity > 0.0, 1.0, -1.0)
    return direction * _friction_level(layout, motion, body, direction, np.abs(velocity))


def balance_terms(model: Model, along: MotionInWindows) -> BalanceTerms:
    """The balance of a model along a motion, by terms unless a dry friction depends on other terms."""
    dry = [(one.effect.friction, one.effect.settle) for one in model.effects if one.effect.friction is not None]
    raised = any(friction.arguments[_ARRIVING] or settle is not None for friction, settle in dry)
    return (WholeBalance if raised else BalanceTerms)(model, along)
