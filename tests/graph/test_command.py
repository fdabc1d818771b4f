"""The environment of a graph's nodes."""

from __future__ import annotations

from idloop.graph.command import node_environment

RANGE, DOMAIN = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID"


def test_a_graph_stays_on_this_machine_unless_told_otherwise(monkeypatch):
    monkeypatch.delenv(RANGE, raising=False)
    assert node_environment()[RANGE] == "LOCALHOST"
    monkeypatch.setenv(RANGE, "SUBNET")
    assert node_environment()[RANGE] == "SUBNET"


def test_a_domain_is_that_of_the_caller_unless_given(monkeypatch):
    monkeypatch.setenv(DOMAIN, "7")
    assert node_environment()[DOMAIN] == "7"
    assert node_environment(8)[DOMAIN] == "8"
