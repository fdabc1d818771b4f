"""trajectory_msgs/JointTrajectory as bytes: ours, ROS's, and spoilt ones."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.codec import CdrError, TrajectoryPoint, decode_trajectory, encode_trajectory

numbers = st.lists(st.floats(allow_nan=False), min_size=2, max_size=2).map(tuple)
points = st.lists(st.builds(TrajectoryPoint, st.integers(0, 2**60), numbers, numbers), max_size=5).map(tuple)
stamps = st.integers(0, 2**60)
NAMES = ("elbow", "wrist_roll")


@given(stamps, points)
def test_a_trajectory_comes_back(stamp, rows):
    assert decode_trajectory(encode_trajectory(stamp, NAMES, rows)) == (stamp, NAMES, rows)


@pytest.mark.ros
@given(stamps, points)
def test_ros_reads_ours_and_we_its(stamp, rows):
    serialization = pytest.importorskip("rclpy.serialization")
    from trajectory_msgs.msg import JointTrajectory

    data = encode_trajectory(stamp, NAMES, rows)
    message = serialization.deserialize_message(data, JointTrajectory)
    assert tuple(message.joint_names) == NAMES
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(stamp, 10**9)
    for point, row in zip(message.points, rows, strict=True):
        assert tuple(point.positions) == row.position
        assert tuple(point.velocities) == row.velocity
        assert (point.time_from_start.sec, point.time_from_start.nanosec) == divmod(row.since_ns, 10**9)
        assert len(point.accelerations) == len(point.effort) == 0
    assert decode_trajectory(serialization.serialize_message(message)) == (stamp, NAMES, rows)


@given(st.integers(0, 400), st.integers(0, 255), st.integers(0, 400))
def test_a_spoilt_message_is_refused_or_read(where, byte, length):
    data = bytearray(encode_trajectory(7, NAMES, [TrajectoryPoint(5, (1.0, 2.0), (3.0, 4.0))]))
    data[where % len(data)] = byte
    try:
        decode_trajectory(bytes(data[: length or len(data)]))
    except CdrError:
        return
