"""Which node publishes and subscribes what in a graph."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.descriptions import describe
from idloop_nodes.graph_start import command_topic, expected_publishers, expected_subscribers, subscriptions


def test_the_wiring_is_closed():
    """Every stream that a node subscribes is published by another, else the start barrier would never open."""
    graph = ("excitation", "controller", "plant", "bridge", "recorder", "estimator")
    for kind in graph:
        for topic in subscriptions(kind, graph):
            assert expected_publishers(topic, graph) >= 1, topic
        for topic in describe(kind).publishes:
            assert expected_subscribers(topic, graph) >= 1, topic


def test_behind_a_bridge_the_applied_command_counts():
    robot, simulated = (
        ("controller", "bridge", "recorder", "estimator"),
        ("controller", "plant", "recorder", "estimator"),
    )
    assert command_topic("joint_command", robot) == "bridge/command"
    assert command_topic("joint_command", simulated) == "joint_command"
    assert command_topic("motor/command", robot) == "motor/command"
    # the recorder and the bridge hear the one, recorder and estimator the other
    assert (expected_subscribers("joint_command", robot), expected_subscribers("bridge/command", robot)) == (2, 2)
    assert expected_subscribers("joint_command", simulated) == 3
