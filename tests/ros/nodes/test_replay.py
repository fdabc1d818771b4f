"""What a recording is played as."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.records import make_stream, write_bag
from idloop_nodes.codec import JointReader
from idloop_nodes.nodes.replay import ReplayNode

pytestmark = [pytest.mark.ros]
STAMPS = 10**9 + np.arange(5) * 10_000_000


@pytest.mark.parametrize(("bridge", "sent"), [(False, 1.0), (True, 0.25)])
def test_behind_a_bridge_its_word_is_played_as_the_command(tmp_path, bridge, sent):
    streams = [
        make_stream("axis/joint_command", STAMPS, {"motor": {"effort": np.full(5, 1.0)}}),
        make_stream("axis/joint_states", STAMPS, {"motor": {"position": np.zeros(5)}}),
    ]
    if bridge:
        streams.append(make_stream("axis/bridge/command", STAMPS, {"motor": {"effort": np.full(5, 0.25)}}))
    bag = write_bag(tmp_path / "bag", streams)
    reader = JointReader([("motor", "effort")])
    played = [
        (topic, reader.read(data)[1][0] if topic == "joint_command" else None)
        for topic, _, data in ReplayNode._read(None, bag, {"joint_command", "joint_states"})
    ]
    assert played.count(("joint_states", None)) == 5
    assert [value for topic, value in played if topic == "joint_command"] == [sent] * 5
