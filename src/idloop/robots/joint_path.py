"""The path of a planned motion of all joints: read from a file, held against limits, evaluated anywhere.

Between its points it is a cubic in each joint with the given positions and velocities, which is what a
joint_trajectory_controller follows where a trajectory has no accelerations.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.documents import read_yaml
from idloop.errors import InputError
from idloop.robots.joint_limits import JointLimits

_DENSE = 8  # checks between two points
_AT_REST = 1e-6  # of the velocity limit: a velocity that counts as none
_MARGIN = 1e-6  # for numbers that were written with nine digits


class JointPath:
    """Positions of all joints over a path time.

    `time` (n,): ascending, from 0 [s]. `position`, `velocity` (n, joints). Raises InputError: fewer than two points,
    numbers that are not finite, or times that do not ascend.
    """

    def __init__(self, joints: Sequence[str], time: Array, position: Array, velocity: Array) -> None:
        from scipy.interpolate import CubicHermiteSpline

        self.joints = tuple(joints)
        if len(time) < 2:
            raise InputError("the trajectory has fewer than two points")
        if not all(np.all(np.isfinite(one)) for one in (time, position, velocity)):
            raise InputError("the trajectory has a number that is not finite")
        if np.any(np.diff(time) <= 0.0):
            first = float(time[int(np.argmax(np.diff(time) <= 0.0)) + 1])
            raise InputError(f"the times of the trajectory do not ascend: {first:g} s comes after a later one")
        self.time, self.position, self.velocity = time - time[0], position, velocity
        self._place = CubicHermiteSpline(self.time, position, velocity)
        self._speed = self._place.derivative()
        self._bend = self._place.derivative(2)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Position and velocity (n, joints) at path times (n,); beyond an end that of the end."""
        inside = np.clip(time, 0.0, self.duration)
        return self._place(inside), self._speed(inside)

    def refuse(self, limits: JointLimits, stop_time: float) -> None:
        """Raise InputError where the motion exceeds a limit, or could not be stopped on the path within it.

        A motion that slows down from its full speed to rest, or speeds up from rest, at a constant rate within
        `stop_time` [s] accelerates at most by abs(q″) + abs(q′) / stop_time.
        """
        self._refuse_ends(limits)
        whole = np.concatenate([np.linspace(a, b, _DENSE, endpoint=False) for a, b in pairwise(self.time)])
        times = np.append(whole, self.duration)
        place, speed = self._place(times), np.abs(self._speed(times))
        push = np.abs(self._bend(times)) + speed / stop_time
        beyond = np.maximum(place - limits.upper, limits.lower - place)
        k, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[k, j] > _MARGIN:
            raise InputError(
                f"the trajectory takes {self.joints[j]} to {place[k, j]:.4g} after {times[k]:.3g} s, beyond its "
                f"limits {limits.lower[j]:.4g} .. {limits.upper[j]:.4g}"
            )
        self._refuse_above(
            times, speed, limits.velocity, "moves {joint} at {value:.4g}", "its velocity limit {limit:.4g}"
        )
        self._refuse_above(
            times, push, limits.acceleration,
            f"needs an acceleration of {{value:.4g}} of {{joint}} to be stopped in {stop_time:g} s",
            "the limit of the acceleration {limit:.4g}: plan it with a smaller --max-acceleration, allow more, or a "
            "longer stop_time",
        )  # fmt: skip

    def _refuse_above(self, times: Array, values: Array, limit: Array, does: str, bound: str) -> None:
        over = values / limit
        k, j = np.unravel_index(int(np.argmax(over)), over.shape)
        if over[k, j] > 1.0 + _MARGIN:
            does = does.format(joint=self.joints[j], value=float(values[k, j]))
            raise InputError(f"the trajectory {does} after {times[k]:.3g} s, beyond {bound.format(limit=limit[j])}")

    def _refuse_ends(self, limits: JointLimits) -> None:
        for place, word in ((0, "begin"), (-1, "end")):
            moving = np.abs(self.velocity[place]) > _AT_REST * limits.velocity
            if np.any(moving):
                joint = self.joints[int(np.argmax(moving))]
                raise InputError(f"the trajectory does not {word} at rest: {joint} moves")

    def approached_from(self, position: Array, limits: JointLimits, share: float, stop_time: float) -> JointPath:
        """Return the path behind a straight line in joint space from a position at rest to its beginning.

        `position` (joints,). `share`: part of the limits of velocity and acceleration that the line may use.
        `stop_time`: as of `refuse` [s].
        """
        gap = np.abs(self.position[0] - position)
        # A cubic from rest to rest: its largest velocity is 1.5 gap / T, its largest acceleration 6 gap / T².
        speed = float(np.max(1.5 * gap / (share * limits.velocity)))
        push = float(np.max(np.sqrt(6.0 * gap / (share * limits.acceleration))))
        halt = float(np.max(1.5 * gap / (share * limits.acceleration * stop_time)))
        duration = max(speed, push + halt, stop_time)
        return JointPath(
            self.joints,
            np.concatenate([[0.0], duration + self.time]),
            np.vstack([position, self.position]),
            np.vstack([np.zeros(len(self.joints)), self.velocity]),
        )


def read_path(path: Path | str) -> JointPath:
    """Read a trajectory as `idloop robot excite` writes it, ``.csv`` or ``.yaml``.

    Raises InputError: the file cannot be read, or holds no trajectory with positions and velocities.
    """
    file = Path(path)
    try:
        if file.suffix.lower() == ".csv":
            return _from_table(list(csv.reader(io.StringIO(file.read_text(encoding="utf-8")))))
        return _from_message(read_yaml(file.read_text(encoding="utf-8"), str(path)))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except InputError as error:
        known = str(error).startswith(str(path))
        raise error if known else InputError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"{path}: is no trajectory with positions, velocities and times of every point; write one with `idloop "
            "robot excite`"
        ) from error


def _from_table(rows: list[list[str]]) -> JointPath:
    header, table = rows[0], np.array(rows[1:], dtype=float)
    joints = [name.removesuffix(".position") for name in header if name.endswith(".position")]
    position, velocity = (
        table[:, [header.index(f"{joint}.{field}") for joint in joints]] for field in ("position", "velocity")
    )
    return JointPath(joints, table[:, header.index("time")], position, velocity)


def _from_message(document: Any) -> JointPath:
    points = document["points"]
    joints = [str(name) for name in document["joint_names"]]
    position, velocity = (
        np.array([one[field] for one in points], dtype=float).reshape(len(points), len(joints))
        for field in ("positions", "velocities")
    )
    since = [one["time_from_start"] for one in points]
    time = np.array([one["sec"] + 1e-9 * one["nanosec"] for one in since], dtype=float)
    return JointPath(joints, time, position, velocity)
