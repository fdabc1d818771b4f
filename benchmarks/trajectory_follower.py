"""What a joint_trajectory_controller of ros2_control does with a trajectory, without ROS and without a clock.

Cubics between the points, from where the robot is told to be when a message comes; a message that ends in the past, or
in motion, is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from idloop_nodes.codec import TrajectoryPoint

Array = NDArray[np.float64]

SECOND = 1_000_000_000


class Follower:
    """Where a robot is told to be, from the newest trajectory.

    `joints`: names; `position`: where it rests at first (joints,). Attributes: `refused`: messages that were refused.
    """

    def __init__(self, joints: Sequence[str], position: Array) -> None:
        self.refused = 0
        self._joints = tuple(joints)
        self._curve: Any = None
        self._begin, self._end = 0, 0
        self._rest = position

    def take(self, now_ns: int, stamp_ns: int, names: tuple[str, ...], points: tuple[TrajectoryPoint, ...]) -> None:
        """Take in a trajectory; `stamp_ns`: time from which it counts, 0: now."""
        begin = stamp_ns or now_ns
        if (
            not points
            or sorted(names) != sorted(self._joints)
            or begin + points[-1].since_ns < now_ns
            or any(points[-1].velocity)
        ):
            self.refused += 1
            return
        order = [names.index(joint) for joint in self._joints]
        time = np.array([one.since_ns for one in points]) / SECOND
        position = np.array([one.position for one in points])[:, order]
        velocity = np.array([one.velocity for one in points])[:, order]
        until_first = (begin - now_ns) / SECOND + time[0]
        if until_first > 0.0:
            where = self.at(now_ns)
            time = np.concatenate([[time[0] - until_first], time])
            position, velocity = np.vstack([where[0], position]), np.vstack([where[1], velocity])
        self._rest = position[-1]
        self._curve = CubicHermiteSpline(time, position, velocity)
        self._begin, self._end = begin, begin + points[-1].since_ns

    def at(self, now_ns: int) -> tuple[Array, Array]:
        """Position and velocity (joints,)."""
        if self._curve is None or now_ns >= self._end:
            return self._rest, np.zeros(len(self._joints))
        since = (now_ns - self._begin) / SECOND
        return self._curve(since), self._curve(since, 1)
