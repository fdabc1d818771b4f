"""Messages that command a robot (Float64, Float64MultiArray, JointTrajectory): bytes to values and back."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from idloop.records.bags.cdr import HEADER, CdrReader, CdrWriter

_FLOAT = struct.Struct("<d")
_EMPTY_LAYOUT = bytes(8)  # no dimensions, data offset 0


def encode_float(value: float) -> bytes:
    """Return std_msgs/Float64 as bytes."""
    return HEADER + _FLOAT.pack(value)


def encode_floats(values: Sequence[float]) -> bytes:
    """Return std_msgs/Float64MultiArray without dimensions, as controllers of ros2_control take it."""
    padding = bytes(4) if values else b""
    return HEADER + _EMPTY_LAYOUT + struct.pack("<I", len(values)) + padding + struct.pack(f"<{len(values)}d", *values)


@dataclass(frozen=True)
class TrajectoryPoint:
    """One trajectory_msgs/JointTrajectoryPoint with positions and velocities."""

    since_ns: int  # from the stamp of the trajectory [ns]
    position: tuple[float, ...]
    velocity: tuple[float, ...]


def encode_trajectory(stamp_ns: int, names: Sequence[str], points: Sequence[TrajectoryPoint]) -> bytes:
    """Return trajectory_msgs/JointTrajectory as bytes; its points count from the stamp [ns], 0: from its arrival."""
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
    """Return stamp, joints and points of a trajectory_msgs/JointTrajectory; CdrError when it is none."""
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
