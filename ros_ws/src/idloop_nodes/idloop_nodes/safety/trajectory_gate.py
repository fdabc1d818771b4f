"""A planned motion along its path: its pace, and the gate that releases it piece by piece."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.records.bags.cdr import SECOND
from idloop.robots.joint_limits import JointLimits
from idloop.robots.joint_path import JointPath
from idloop_nodes.safety.interlock import Interlock
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

STEP = 0.02  # distance of two points of a piece, and of two pieces [s]
REST = 0.1  # for which a piece stays at rest, so that one that comes late does not end in the past [s]
# Time for which a neutral piece goes on: the guardian sends it when no beat has come for 0.03 s. The arm is where the
# piece is then, so that its speed does not jump [s].
UNNOTICED = 0.05
APPROACH_SHARE = 0.2  # of the limits of velocity and acceleration that a line to the beginning of the path uses

Array = NDArray[np.float64]

AT_REST = 1e-6  # a smaller pace is none: what is left of rounding


@dataclass(frozen=True)
class PathTiming:
    """How far a motion is on its path after an instant.

    The pace is the path time that passes in a second: 0 at rest, 1 as planned. It grows to 1 at the rate 1 / `ramp`,
    and after `go` seconds falls to 0 at the same rate, so that whoever receives nothing more comes to rest on the path.
    """

    place: float  # path time at the instant [s]
    pace: float  # at the instant, in [0, 1]
    go: float  # time for which the motion goes on [s]; 0: it slows down at once
    ramp: float  # time from rest to the full pace and back [s]

    @property
    def until_rest(self) -> float:
        """Time until the motion rests [s]."""
        return self.go + self.ramp * min(1.0, self.pace + self.go / self.ramp)

    def after(self, elapsed: Array) -> tuple[Array, Array]:
        """Path times [s] and paces at times after the instant [s]; an array of shape (n,) each."""
        going = np.clip(elapsed, 0.0, self.go)
        speeding = np.minimum(going, (1.0 - self.pace) * self.ramp)
        fastest = self.pace + speeding / self.ramp
        place = self.place + speeding * 0.5 * (self.pace + fastest) + (going - speeding) * fastest
        slowing = np.clip(elapsed - self.go, 0.0, fastest * self.ramp)
        pace = fastest - slowing / self.ramp
        return place + slowing * 0.5 * (fastest + pace), np.where(pace > AT_REST, pace, 0.0)

    def at(self, elapsed: float) -> tuple[float, float]:
        """Path time [s] and pace at one time after the instant [s]."""
        place, pace = self.after(np.array([elapsed]))
        return float(place[0]), float(pace[0])


@dataclass(frozen=True)
class TrajectorySettings:
    """What a gate of trajectories allows."""

    limits: JointLimits
    following_error: float  # largest distance of a measured position from the planned one [rad or m]
    approach: float  # largest distance of a joint from the beginning of the path that a straight line closes
    stop_time: float  # from the full pace to rest, and back [s]
    horizon: float  # time for which a piece goes on before it slows down [s]
    watchdog: float  # silence of the measurement after which the arm is stopped [s]
    latch_watchdog: bool = False  # what the watchdog found stays until reset


@dataclass(frozen=True)
class Piece:
    """Points of a trajectory from now on; the last one is at rest."""

    time: Array  # (n,) from now [s]
    position: Array  # (n, joints)
    velocity: Array  # (n, joints)


class TrajectoryGate(Interlock[Piece]):
    """Measurements in, pieces of the planned motion to be sent out; None where nothing is.

    Times are nanoseconds of a steady clock, stamps those of the messages. Attributes beside those of `Interlock`:
    `measurements`: watch of the stream.

    Raises InputError: a path that exceeds a limit, or that could not be stopped within them.
    """

    def __init__(self, path: JointPath, settings: TrajectorySettings) -> None:
        path.refuse(settings.limits, settings.stop_time)
        self.measurements = StreamWatch(round(settings.watchdog * SECOND))
        super().__init__(
            {"measurement": self.measurements}, watchdog=settings.watchdog, latch_watchdog=settings.latch_watchdog
        )
        self._planned = path
        self._settings = settings
        self._path: JointPath | None = None  # with the line to its beginning; None before the motion
        self._timing = PathTiming(0.0, 0.0, 0.0, settings.stop_time)
        self._since = 0
        self._neutral = (self._timing, self._since)  # the motion of the newest neutral command
        self._sent = 0  # time of the newest piece
        self._too_far = ""  # why the motion cannot begin
        self._off_path = False  # whether the path is that of a stop beside the planned one

    # what comes in

    def measure(
        self, now_ns: int, stamp_ns: int, position: Sequence[float], velocity: Sequence[float], effort: Sequence[float]
    ) -> Piece | None:
        """Take in a measurement, velocity and effort NaN where not measured; return what has to be sent at once."""
        arrival = self.measurements.update(now_ns, stamp_ns)
        if arrival is Arrival.STALE:
            return None
        joints = self._settings.limits.joints
        named = {f"position of {joint}": value for joint, value in zip(joints, position, strict=True)}
        if self.take("measurement", arrival, **named):
            self._watch(now_ns, np.array(position), np.array(velocity), effort)
        passed = not self.reason
        return self._decide(now_ns) if self.blocked(now_ns) and passed else None

    def tick(self, now_ns: int) -> Piece | None:
        """Advance the time; return the next piece when it is due, or at once when the arm has to stop."""
        stops = bool(self.blocked(now_ns)) and not self.reason
        return self._decide(now_ns) if stops or now_ns - self._sent >= round(STEP * SECOND) else None

    # orders

    def reset(self) -> str:
        """Forget what was latched, and the path where the arm has left it; return why that cannot be."""
        refused = super().reset()
        if not refused and self._off_path:
            self._path, self._off_path = None, False
        return refused

    def neutral_command(self, now_ns: int) -> Piece | None:
        """Return what has to be sent if no further call comes; None where the arm does not move by this gate."""
        go = 0.0 if self.reason else min(UNNOTICED, self._settings.horizon)
        self._neutral = self._from_now(now_ns, go), now_ns
        return self._halt(self._neutral[0]) if self.mine(now_ns) else None

    def handed_over(self) -> None:
        """Take in that the newest neutral command was sent in place of this gate: the arm has slowed down by it."""
        self._timing, self._since = self._neutral

    @property
    def share_done(self) -> float:
        """Part of the path that lies behind, in [0, 1]."""
        return 0.0 if self._path is None or self._off_path else min(self._timing.place / self._path.duration, 1.0)

    def planned(self, now_ns: int) -> tuple[Array, Array] | None:
        """Position and velocity (joints,) where the arm is told to be; None before the motion."""
        if self._path is None:
            return None
        place, pace = self._timing.at((now_ns - self._since) / SECOND)
        position, velocity = self._path.at(np.array([place]))
        return position[0], pace * velocity[0]

    # decisions

    def _watch(self, now_ns: int, position: Array, velocity: Array, effort: Sequence[float]) -> None:
        """Compare the motion of the arm with its limits and with its path."""
        self._breach = self._settings.limits.breach(position, velocity, effort)
        if self._path is None:
            self._too_far = self._begin(now_ns, position)
        elif not self._off_path:
            self._follow(now_ns, position, velocity)

    def _follow(self, now_ns: int, position: Array, velocity: Array) -> None:
        """Stop an arm that is too far from where it is told to be, along a straight line from where it is."""
        planned = self.planned(now_ns)
        away = np.abs(position - planned[0]) if planned else np.zeros(1)
        worst = int(np.argmax(away))
        if away[worst] <= self._settings.following_error:
            return
        if not self.mine(now_ns):  # somebody else moves it: the next motion begins from where it is then
            self._path = None
            return
        self.latched = f"{self._settings.limits.joints[worst]} is {away[worst]:.4g} away from the trajectory"
        time = np.array([0.0, self._settings.stop_time])
        speed = np.where(np.isfinite(velocity), velocity, 0.0)
        self._path = JointPath(self._planned.joints, time, position + np.outer(time, speed), np.tile(speed, (2, 1)))
        self._timing, self._since, self._off_path = self._slow(0.0, 1.0, 0.0), now_ns, True

    def _begin(self, now_ns: int, position: Array) -> str:
        """Lay the path from where the arm rests; return why that cannot be."""
        settings = self._settings
        away = np.abs(position - self._planned.position[0])
        worst = int(np.argmax(away))
        if away[worst] > settings.approach:
            return (
                f"{settings.limits.joints[worst]} is {away[worst]:.4g} away from the beginning of the trajectory, more "
                f"than approach {settings.approach:g}: bring it there"
            )
        if self.active and not (self.latched or self._breach or self.forbidden):
            self._path = self._planned.approached_from(position, settings.limits, APPROACH_SHARE, settings.stop_time)
            self._timing, self._since = self._slow(0.0, 0.0, 0.0), now_ns
        return ""

    def blocked(self, now_ns: int) -> str:
        """Why the arm may not move; what stays until reset is latched on the way."""
        return super().blocked(now_ns) or self._too_far

    def _decide(self, now_ns: int) -> Piece | None:
        reason = self.blocked(now_ns)
        self.decided(reason)
        if not self.mine(now_ns):
            return None
        timing = self._from_now(now_ns, 0.0 if reason else self._settings.horizon)
        self._timing, self._since, self._sent = timing, now_ns, now_ns
        return self._halt(timing) if reason else self._piece(timing)

    def _halt(self, timing: PathTiming) -> Piece | None:
        """Return the way to rest; None at rest: the arm holds what it was sent last, wherever others move it."""
        rests = timing.until_rest == 0.0 or self._path is None or timing.place >= self._path.duration
        return None if rests else self._piece(timing)

    def _slow(self, place: float, pace: float, go: float) -> PathTiming:
        return PathTiming(place, pace, go, self._settings.stop_time)

    def _from_now(self, now_ns: int, go: float) -> PathTiming:
        """Return the motion that goes on for a time and then slows down, from where the arm is told to be now."""
        return self._slow(*self._timing.at((now_ns - self._since) / SECOND), go)

    def _piece(self, timing: PathTiming) -> Piece | None:
        if self._path is None:
            return None
        end = timing.until_rest
        time = np.linspace(0.0, end, math.ceil(end / STEP) + 1) if end > 0.0 else np.zeros(1)
        places, paces = timing.after(time)
        position, velocity = self._path.at(places)
        velocity *= paces[:, None]
        velocity[-1] = 0.0  # to the last digit
        return Piece(
            np.append(time, time[-1] + REST), np.vstack([position, position[-1]]), np.vstack([velocity, velocity[-1]])
        )
