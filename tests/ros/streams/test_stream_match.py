"""A node is ready when its own graph is there, whoever else is listening."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from hypothesis import given
from hypothesis import strategies as st

from idloop_nodes.streams.stream_match import RENAMED, Endpoints, StreamMatch

pytestmark = pytest.mark.ros

COUNTS = st.integers(0, 6)


@given(st.builds(Endpoints, COUNTS, COUNTS, COUNTS, COUNTS))
def test_nobody_who_is_known_and_nobody_of_the_graph_is_left_out(stream):
    match = StreamMatch()
    at_once = match.complete([stream], 0.0)
    after = match.complete([stream], RENAMED)
    assert after == (stream.matched >= stream.expected and stream.matched >= stream.known)
    assert at_once == (after and stream.own >= stream.expected)


def test_patience_begins_anew_with_each_new_partner():
    match = StreamMatch()
    renamed, another = Endpoints(2, 0, 2, 2), Endpoints(2, 0, 3, 2)
    assert not match.complete([renamed], 0.0)
    assert not match.complete([another], RENAMED)
    assert not match.complete([renamed], RENAMED + 1.0)
    assert match.complete([renamed], 2.0 * RENAMED + 1.0)


@pytest.mark.usefixtures("ros_environment")
def test_strangers_do_not_stand_in_for_the_nodes_of_the_graph(bench):
    bench = bench("excitation", peers="[excitation, controller, recorder]", start_timeout=100.0)
    for _ in range(3):
        bench.listen("excitation")
        bench.listen("reference")
    publishers = bench.node.publishers_by_topic.values()
    bench.until(lambda: all(one.get_subscription_count() == 3 for one in publishers))
    assert bench.node.start.unconnected()

    import rclpy

    from idloop_nodes.qos import topic_qos, topic_type

    nodes = [rclpy.create_node(name) for name in ("controller", "recorder")]
    try:
        for node in nodes:
            for topic in ("excitation", "reference"):
                node.create_subscription(topic_type(topic), topic, print, topic_qos(topic))
        bench.until(lambda: not bench.node.start.unconnected())
        assert bench.node.start.connected()
        assert all(one.get_subscription_count() == 5 for one in publishers)
    finally:
        for node in nodes:
            node.destroy_node()
