"""A short form of the soak: a graph at 1 kHz in real time whose samples and memory are counted."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

import soak

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph, pytest.mark.slow]


def test_a_short_soak_counts_and_leaves_nothing(tmp_path, ros_environment, capsys):
    soak.run(tmp_path, 5.0)
    said = capsys.readouterr().out
    assert "samples in 5 s" in said
    assert "growth since" in said
    for word in ("Traceback", "zombie", "left behind"):
        assert word not in said
