"""What the page says of its stop while the bridge hangs, on a real graph."""

from __future__ import annotations

import json
import re
import signal
import urllib.request

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from robot_graph import RobotGraph

from idloop.reporting.workbench.server import KEY_HEADER
from idloop.reporting.workbench.state import FREE, SENT, STOPPED

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph]


class Page:
    """The workbench of a graph, asked over HTTP as a browser does."""

    def __init__(self, graph):
        graph.until(lambda: "the workbench is at http" in graph.said("workbench"))
        self.address = re.search(r"the workbench is at (\S+)", graph.said("workbench"))[1]
        with urllib.request.urlopen(self.address, timeout=60) as response:
            self.key = re.search(r'data-key="([^"]+)"', response.read().decode())[1]

    @property
    def stop(self):
        with urllib.request.urlopen(f"{self.address}state", timeout=60) as response:
            return json.load(response)["stop"]

    def post(self, path, **body):
        headers = {KEY_HEADER: self.key, "Content-Type": "application/json"}
        request = urllib.request.Request(f"{self.address}{path}", json.dumps(body).encode(), headers)
        with urllib.request.urlopen(request, timeout=60) as response:
            assert response.status == 200


@pytest.fixture
def graph(tmp_path, ros_environment):
    page = {"port": 0, "bridge_node": "bridge", "sample_time": 0.005, "history": 10.0}
    one = RobotGraph(tmp_path, {}, {"workbench": page})
    try:
        yield one
    finally:
        one.stop()


@pytest.mark.slow
def test_stopped_is_not_said_while_the_bridge_hangs(graph):
    page = Page(graph)
    graph.until_driven()
    assert page.stop == FREE
    graph.signal("bridge", signal.SIGSTOP)
    page.post("stop")
    graph.until(lambda: page.stop == SENT)
    before = len(graph.sent())
    while len(graph.sent()) < before + 400:  # 2 s of the robot's time
        assert page.stop == SENT
    graph.signal("bridge", signal.SIGCONT)
    graph.until(lambda: page.stop == STOPPED)
    assert graph.newest()[1] == 0.0
    graph.signal("bridge", signal.SIGSTOP)
    graph.until(lambda: page.stop == SENT)  # what it has confirmed is no news any more
    graph.signal("bridge", signal.SIGCONT)
    graph.until(lambda: page.stop == STOPPED)
    page.post("order", verb="reset")
    graph.until(lambda: page.stop == FREE)
    graph.until_driven()
