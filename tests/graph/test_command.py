"""The environment of one node: the profile of Fast DDS that comes with a graph."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from idloop.graph.command import OWN_PROFILES, PROFILE_VARIABLES, node_environment

SCRIPT = """
import rclpy
from std_msgs.msg import Header
rclpy.init()
rclpy.create_node('alone').create_publisher(Header, 'alone', 1).publish(Header())
rclpy.shutdown()
"""


@pytest.fixture(autouse=True)
def no_profile(monkeypatch):
    for name in PROFILE_VARIABLES:
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("distribution", "variable", "profile"),
    [
        ("humble", "FASTRTPS_DEFAULT_PROFILES_FILE", "fast_discovery.xml"),
        ("jazzy", "FASTRTPS_DEFAULT_PROFILES_FILE", "fast_discovery.xml"),
        ("kilted", "FASTDDS_DEFAULT_PROFILES_FILE", "graph_profile.xml"),
        ("", "FASTDDS_DEFAULT_PROFILES_FILE", "graph_profile.xml"),
    ],
)
def test_each_fast_dds_gets_a_profile_whose_words_it_knows(monkeypatch, distribution, variable, profile):
    monkeypatch.setenv("ROS_DISTRO", distribution)
    environment = node_environment()
    assert {name for name in PROFILE_VARIABLES if name in environment} == {variable}
    assert Path(environment[variable]).name == profile
    assert environment[variable] in OWN_PROFILES


def test_a_profile_of_the_users_own_stays(monkeypatch):
    monkeypatch.setenv(PROFILE_VARIABLES[1], "mine.xml")
    environment = node_environment()
    assert {environment.get(name) for name in PROFILE_VARIABLES} == {None, "mine.xml"}


@pytest.mark.ros
def test_fast_dds_understands_every_word_of_the_profile():
    pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=node_environment(), capture_output=True, text=True, check=True, timeout=200
    )
    assert "XML" not in done.stderr, done.stderr
