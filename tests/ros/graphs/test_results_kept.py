"""Results are latched one deep, and yet who takes them late gets every one."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]


def test_a_recorder_that_is_late_gets_every_result(bench):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.duration import Duration
    from rclpy.serialization import deserialize_message

    one = bench("estimator", model="dc_motor", sample_time=0.01, mode="realtime", auto_diagnose=False)
    stream = one.node.poll_topic("estimator/wear")
    publisher = one.talk("estimator/wear")
    one.matched(publisher)
    for second in range(1, 6):
        message = DiagnosticArray()
        message.header.stamp.sec = second
        publisher.publish(message)
        assert publisher.wait_for_all_acked(Duration(seconds=60))
    got = []

    def all_there():
        got.extend(deserialize_message(data, DiagnosticArray).header.stamp.sec for data, _ in stream.take())
        return len(got) >= 5

    one.until(all_there)
    assert got == [1, 2, 3, 4, 5]
