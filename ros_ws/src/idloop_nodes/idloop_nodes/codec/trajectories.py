"""trajectory_msgs/JointTrajectory: bytes to values and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from idloop.records.bags.cdr import CdrReader, CdrWriter


@dataclass(frozen=True)
class TrajectoryPoint:
    """One trajectory_msgs/JointTrajectoryPoint with positions and velocities."""

    since_ns: int  # from the stamp of the trajectory [ns]
    position: tuple[float, ...]
    velocity: tuple[float, ...]


def encode_trajectory(stamp_ns: int, names: Sequence[str], points: Sequence[TrajectoryPoint]) -> bytes:
    """Return trajectory_msgs/JointTrajectory as bytes.

    `stamp_ns`: time from which the points count [ns], 0: from its arrival.
    """
    writer = CdrWriter()
    writer.stamp(stamp_ns)
    writer.string("")
    writer.uint32(len(names))
    for name in names:
        writer.string(name)
    writer.uint32(len(points))
    for point in points:
        writer.doubles(point.position)
        writer.doubles(point.velocity)
        writer.doubles(())  # accelerations
        writer.doubles(())  # efforts
        writer.stamp(point.since_ns)  # a Duration has the same fields
    return writer.finish()


def decode_trajectory(data: bytes) -> tuple[int, tuple[str, ...], tuple[TrajectoryPoint, ...]]:
    """Return stamp, joints and points of a trajectory_msgs/JointTrajectory.

    Raises CdrError: when the bytes are cut short or no JointTrajectory.
    """
    reader = CdrReader(data)
    stamp, _ = reader.stamp(), reader.string()
    names = tuple(reader.string() for _ in range(reader.count(5)))
    points = []
    for _ in range(reader.count(24)):
        position, velocity = reader.doubles(), reader.doubles()
        reader.doubles()
        reader.doubles()
        points.append(TrajectoryPoint(reader.stamp(), position, velocity))
    return stamp, names, tuple(points)
