"""Trajectories that show most of a robot's parameters: periodic Fourier series, optimised within limits.

Position of each joint: q(t) = q₀ + Σ_l a_l sin(l ω t) / (l ω) − b_l cos(l ω t) / (l ω) (Swevers, Ganseman, Tükel, de
Schutter and Van Brussel, IEEE Trans. Robotics and Automation 13, 1997), with Σ a_l = 0 and Σ l b_l = 0, so that it
begins and ends at rest. Minimised is −log det of the information on the base parameters (D-optimality), with penalties
beyond the limits of position, velocity, acceleration, effort and distance; what remains beyond a limit is scaled away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.linalg import qr
from scipy.optimize import minimize

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.robots.balance import OF_JOINT
from idloop.robots.collision import SelfCollision
from idloop.robots.rigid_body import PER_LINK, RigidBody
from idloop.spelling import listed

Report = Callable[[float, str], None]

_POINTS = 80  # of a period in the optimisation
_DENSE = 5  # times as many in the final check
_PENALTY = 300.0
_SHRINK = 0.95
_FREE_RANGE = np.pi  # of a joint without limits, to either side of 0 [rad]
_FREE_VELOCITY = 1.0  # of a joint without a limit [rad/s]
_STANDING = 0.1  # speed at which dry friction is taken as a half of its level, as a part of the limit
_RANK = 1e-6
_NO_TRAJECTORY = "no trajectory within the limits was found: widen the limits of the URDF or take a larger share"
_TRIES = 20  # random middles for each start: some are not free


@dataclass(frozen=True)
class Limits:
    """What a trajectory stays within."""

    # shape (joints,): [rad or m, and per s and s², N·m or N]
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array
    distance: float  # least distance between links [m]

    @property
    def middle(self) -> Array:
        """Middle of the ranges of positions."""
        return np.asarray(0.5 * (self.lower + self.upper))

    @property
    def half(self) -> Array:
        """Half of the ranges of positions."""
        return np.asarray(0.5 * (self.upper - self.lower))


def limits_of(robot: RigidBody, share: float, acceleration: float | None, distance: float) -> Limits:
    """Limits of the description, each reduced to a share of it. Raises InputError: a share that is none."""
    if not 0.0 < share <= 1.0:
        raise InputError(f"share {share:g} of the limits: give a number above 0, 1 at most")
    given = robot.limits
    lower = np.maximum(given["lower"], -_FREE_RANGE)
    upper = np.minimum(given["upper"], _FREE_RANGE)
    middle, half = 0.5 * (lower + upper), 0.5 * share * (upper - lower)
    speed = np.where(np.isfinite(given["velocity"]), given["velocity"], _FREE_VELOCITY)
    most = np.full(len(robot.joints), np.inf if acceleration is None else acceleration)
    return Limits(middle - half, middle + half, share * speed, most, share * given["effort"], distance)


@dataclass(frozen=True)
class Trajectory:
    """A planned motion of all joints."""

    joints: tuple[str, ...]
    time: Array  # shape (n,): [s]
    # shape (n, joints)
    position: Array
    velocity: Array
    acceleration: Array
    condition: float  # condition number of the base parameters' regressor with columns of unit length
    before: float  # the same of the best random trajectory
    distance: float  # least distance between links [m]; infinite where nothing was checked
    notes: tuple[str, ...]


class _Series:
    """Fourier series of all joints; a point has the middle and the free coefficients of each."""

    def __init__(self, joints: int, period: float, harmonics: int) -> None:
        self.joints, self.harmonics = joints, harmonics
        order = np.arange(1, harmonics + 1)
        self.wave = 2.0 * np.pi * order / period
        # Coefficients at rest at the beginning: orthonormal bases of Σ a = 0 and Σ l b = 0.
        self.sine = _null_space(np.ones(harmonics))
        self.cosine = _null_space(order.astype(float))
        self.size = 1 + 2 * (harmonics - 1)

    def at(self, point: Array, time: Array) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration (n, joints)."""
        own = point.reshape(self.joints, self.size)
        a = self.sine @ own[:, 1 : self.harmonics].T
        b = self.cosine @ own[:, self.harmonics :].T
        s, c = np.sin(np.outer(time, self.wave)), np.cos(np.outer(time, self.wave))
        w = self.wave
        position: Array = own[:, 0] + (s / w) @ a - (c / w) @ b
        return position, c @ a + s @ b, -(s * w) @ a + (c * w) @ b

    def scaled(self, point: Array, factor: float) -> Array:
        """The point with smaller waves about the same middle."""
        own = point.reshape(self.joints, self.size).copy()
        own[:, 1:] *= factor
        smaller: Array = own.ravel()
        return smaller


def _null_space(row: Array) -> Array:
    return np.asarray(np.linalg.svd(row[None])[2][1:].T)


def plan(
    robot: RigidBody,
    limits: Limits,
    *,
    period: float,
    periods: int,
    harmonics: int,
    rate: float,
    starts: int,
    steps: int,
    seed: int,
    report: Report,
) -> Trajectory:
    """Optimise a trajectory within limits.

    `period`: [s]. `rate`: points per second of the result. `starts`: random trajectories, of which the best is
    optimised. `steps`: of the optimiser. Raises InputError: no trajectory within the limits.
    """
    empty = [name for name, low, high in zip(robot.joints, limits.lower, limits.upper, strict=True) if not high > low]
    if empty:
        raise InputError(f"no range of positions for {listed(empty)}: correct the limits in the URDF")
    series = _Series(len(robot.joints), period, harmonics)
    collision = SelfCollision(robot)
    time = np.arange(_POINTS) * period / _POINTS
    design = _Design(robot, limits, series, collision, seed)
    random = np.random.default_rng(seed)
    drawn = (design.fitted(design.draw(random), time) for _ in range(_TRIES * max(starts, 1)))
    points = list(islice((one for one in drawn if one is not None), max(starts, 1)))
    if not points:
        raise InputError(_NO_TRAJECTORY)
    best = min(points, key=lambda one: design.cost(one, time))
    before = design.condition(best, time)
    count = 0

    def follow(_: Array) -> None:
        nonlocal count
        count += 1
        report(min(count / max(steps, 1), 1.0), "optimising the trajectory")

    found = minimize(
        design.cost, best, args=(time,), method="L-BFGS-B", callback=follow,
        options={"maxiter": steps, "maxfun": 10**9},
    )  # fmt: skip
    dense = np.arange(_DENSE * _POINTS) * period / (_DENSE * _POINTS)
    point = design.fitted(found.x, dense)
    point = design.fitted(best, dense) if point is None else point
    if point is None:
        raise InputError(_NO_TRAJECTORY)
    grid = np.arange(round(periods * period * rate) + 1) / rate
    position, velocity, acceleration = series.at(point, grid)
    notes = (collision.problem,) if collision.problem else ()
    return Trajectory(
        robot.joints, grid, position, velocity, acceleration, design.condition(point, time), before,
        float(np.min(collision.least_distance(series.at(point, dense)[0]))), notes,
    )  # fmt: skip


class _Design:
    """What a trajectory is judged by."""

    def __init__(self, robot: RigidBody, limits: Limits, series: _Series, collision: SelfCollision, seed: int) -> None:
        self.robot, self.limits, self.series, self.collision = robot, limits, series, collision
        # Base parameters by their columns, of random states.
        random = np.random.default_rng(seed)
        joints = len(robot.joints)
        q, v, a = random.uniform(-1.0, 1.0, size=(3, 40 * joints, joints))
        table = self._table(limits.middle + limits.half * q, limits.velocity * v, a)
        table = table.reshape(-1, (PER_LINK + len(OF_JOINT)) * joints)
        length = np.linalg.norm(table, axis=0)
        shown = np.flatnonzero(length > 1e-9 * np.max(length))
        _, triangle, order = qr(table[:, shown] / length[shown], mode="economic", pivoting=True)
        pivots = np.abs(np.diag(triangle))
        self.columns = shown[order[: int(np.sum(pivots > _RANK * pivots[0]))]]

    def _table(self, q: Array, v: Array, a: Array) -> Array:
        joints = len(self.robot.joints)
        own = np.zeros((len(q), joints, joints, len(OF_JOINT)))
        each = np.arange(joints)
        # A smooth sign, whose slope the optimiser can follow.
        dry = np.tanh(v / (_STANDING * self.limits.velocity))
        own[:, each, each] = np.stack([a, v, dry, np.ones_like(v)], axis=-1)
        return np.concatenate([self.robot.regressor(q, v, a), own.reshape(len(q), joints, -1)], axis=2)

    def draw(self, random: np.random.Generator) -> Array:
        """A random point about the middle of the ranges."""
        series, limits = self.series, self.limits
        own = random.normal(size=(series.joints, series.size)) * limits.velocity[:, None]
        own[:, 0] = limits.middle + 0.3 * limits.half * random.uniform(-1.0, 1.0, series.joints)
        return own.ravel()

    def fitted(self, point: Array, time: Array) -> Array | None:
        """The point with waves that are scaled until the trajectory is within all limits; None where it cannot be."""
        if self._beyond(self.series.scaled(point, 0.0), time[:1]) > 0.0:
            return None
        while self._beyond(point, time) > 0.0:
            point = self.series.scaled(point, _SHRINK)
        return point

    def _beyond(self, point: Array, time: Array) -> float:
        return float(np.max(self._excess(point, time)[0]))

    def _excess(self, point: Array, time: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        """How far each sample is beyond each limit, relative to the limit; negative: within."""
        q, v, a = self.series.at(point, time)
        limits = self.limits
        parts = [np.abs(q - limits.middle) / limits.half, np.abs(v) / limits.velocity]
        if np.any(np.isfinite(limits.acceleration)):
            parts.append(np.abs(a) / limits.acceleration)
        if np.any(np.isfinite(limits.effort)):
            parts.append(np.abs(self.robot.torque(self.robot.nominal, q, v, a)) / limits.effort)
        excess = np.concatenate(parts, axis=1) - 1.0
        if not self.collision.problem:
            near = 1.0 - self.collision.least_distance(q) / max(limits.distance, 1e-3)
            excess = np.column_stack([excess, near])
        return excess, (q, v, a)

    def _information(self, motion: tuple[Array, Array, Array]) -> Array:
        weight = np.where(np.isfinite(self.limits.effort), self.limits.effort, 1.0)
        table = self._table(*motion)[:, :, self.columns] / weight[:, None]
        return table.reshape(-1, len(self.columns))

    def cost(self, point: Array, time: Array) -> float:
        """Negative log determinant of the information per parameter, and penalties."""
        excess, motion = self._excess(point, time)
        table = self._information(motion)
        triangle = np.abs(np.diag(np.linalg.qr(table, mode="r")))
        worth = 2.0 * float(np.mean(np.log(np.maximum(triangle, 1e-12))))
        return -worth + _PENALTY * float(np.sum(np.maximum(excess + 0.01, 0.0) ** 2)) / len(time)

    def condition(self, point: Array, time: Array) -> float:
        """Condition number of the base parameters' regressor with columns of unit length."""
        table = self._information(self.series.at(point, time))
        return float(np.linalg.cond(table / np.linalg.norm(table, axis=0)))


def trajectory_text(found: Trajectory, form: str) -> str:
    """Write a trajectory as ``csv``, or as ``yaml`` in the form of trajectory_msgs/msg/JointTrajectory."""
    if form == "csv":
        names = [f"{joint}.{field}" for joint in found.joints for field in ("position", "velocity", "acceleration")]
        columns = np.stack([found.position, found.velocity, found.acceleration], axis=-1).reshape(len(found.time), -1)
        lines = [",".join(["time", *names])]
        table = np.column_stack([found.time, columns])
        lines += [",".join(f"{value:.9g}" for value in row) for row in table]
        return "\n".join(lines) + "\n"
    lines = ["# trajectory_msgs/msg/JointTrajectory", f"joint_names: [{', '.join(found.joints)}]", "points:"]
    for k, instant in enumerate(found.time):
        fields = ", ".join(
            f"{name}: [{', '.join(f'{value:.9g}' for value in values[k])}]"
            for name, values in (
                ("positions", found.position), ("velocities", found.velocity), ("accelerations", found.acceleration)
            )
        )  # fmt: skip
        whole = round(float(instant) * 1e9)
        lines.append(f"- {{{fields}, time_from_start: {{sec: {whole // 10**9}, nanosec: {whole % 10**9}}}}}")
    return "\n".join(lines) + "\n"
