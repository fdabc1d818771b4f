"""A short form of the fault campaign: what it finds that no busy machine can be the cause of."""

from __future__ import annotations

import random

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from faults import FAULTS
from leftovers import leftovers
from live import LiveGraph
from outcome import Outcome

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph, pytest.mark.slow]
SHORT = (
    "estimator: kill -9, started again",
    "recorder: SIGSTOP, SIGCONT",
    "ten times the rate",
    "foreign messages on joint_states",
    "recorder: kill -9, started again",
    "disk full",
    "bag directory read-only",
    "no new file can be made",
)


@pytest.fixture(scope="module")
def graph(tmp_path_factory, ros_domain_id):
    """One graph for all faults, as in a round of the campaign."""
    folder = tmp_path_factory.mktemp("graph")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv("ROS_LOG_DIR", str(folder / "log"))
        one = LiveGraph(folder)
        try:
            one.until_alive()
            yield one
        finally:
            one.stop()


@pytest.mark.parametrize("name", SHORT)
def test_the_graph_comes_back_and_nothing_recorded_is_lost(graph, name):
    found = FAULTS[name](graph, random.Random(name))
    if any("not counted" in one for one in found.wrong):
        pytest.skip(found.wrong[0])
    assert found.wrong == []
    graph.until(lambda: not leftovers(str(graph.folder), [one.pid for one in graph.processes.values()]))


def test_the_recording_at_the_end_is_whole(graph):
    found = Outcome()
    graph.end_recorder(found)
    assert found.wrong == []
    graph.start("recorder")
    graph.until_alive()
