"""The example graph of a robot, as its user starts it: in a namespace, with recorder and estimator."""

from __future__ import annotations

import fcntl
import os
import select
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph import GraphRun, load_graph
from idloop.graph.command import node_environment
from idloop.physics import load_model
from idloop.records import read_records, read_streams

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph, pytest.mark.usefixtures("ros_environment")]
COMMANDS = 300
REMAPPED = ("/robot/joint_states:=/joint_states", "/robot/commands:=/effort_controller/commands")


@pytest.fixture
def robot(ros_environment, tmp_path):
    """A robot with the topics of the example; its log."""
    log = tmp_path / "robot.log"
    words = [sys.executable, str(Path(__file__).parents[1] / "robot.py"), str(log), "0.01", "--ros-args"]
    words += [word for rule in REMAPPED for word in ("-r", rule)]
    with subprocess.Popen(words, env=node_environment(), stdin=subprocess.PIPE, text=True) as process:
        yield log
        process.communicate("end\n", timeout=200)


def told(log):
    """Commands that the robot has received so far."""
    whole, _, _ = log.read_text(encoding="utf-8").rpartition("\n") if log.exists() else ("", "", "")
    return [float(row[2]) for row in map(str.split, whole.splitlines()) if row[1] == "command"]


@pytest.mark.slow
def test_the_example_drives_and_records_a_joint_of_a_robot(robot, tmp_path):
    said: list[str] = []
    graph = load_graph("robot", {"bag": str(tmp_path / "bag"), "namespace": "left", "fit_period": "0.0"})
    run = GraphRun(graph, say=lambda label, line: said.append(f"{label}: {line}"))
    try:
        run.wait(lambda: sum(command != 0.0 for command in told(robot)) > COMMANDS)
    finally:
        run.stop()
    deadline = time.monotonic() + 200.0
    while told(robot)[-1] != 0.0:  # the bridge's last word, as soon as the robot has read it
        assert time.monotonic() < deadline
        threading.Event().wait(0.01)
    streams = read_streams(tmp_path / "bag")
    states, passed = streams["/left/joint_states"], streams["/left/bridge/command"]
    assert states.names == passed.names == ("motor",), said
    assert np.mean(np.isin(passed.effort[:, 0], told(robot))) > 0.9, "recorded as it was told"
    # The robot is stamped by the clock of this machine, which somebody may set while it runs.
    record = max(read_records(tmp_path / "bag", load_model("dc_motor"), split=True), key=lambda run: run.time.size)
    assert record.output_names == ("motor.position", "motor.velocity")
    assert np.ptp(record.output[:, 1]) > 0.0
    assert any("lost 0, dropped 0" in line for line in said), said


@pytest.mark.slow
def test_a_closed_terminal_ends_the_nodes_in_order(robot, tmp_path):
    """The hangup reaches the launcher alone: its nodes have process groups of their own."""
    ours, terminal = os.openpty()
    words = [sys.executable, "-m", "idloop", "launch", "robot", "namespace:=left", f"bag:={tmp_path / 'bag'}"]
    process = subprocess.Popen(
        [*words, "fit_period:=0.0"],
        env=node_environment(), stdin=terminal, stdout=terminal, stderr=terminal,
        start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY),  # noqa: PLW1509 (no thread of ours)
    )  # fmt: skip
    os.close(terminal)
    try:
        deadline = time.monotonic() + 200.0
        while sum(command != 0.0 for command in told(robot)) < COMMANDS:
            assert time.monotonic() < deadline
            if select.select([ours], [], [], 0.01)[0]:
                os.read(ours, 65536)  # else the launcher would wait for a reader
        os.close(ours)
        process.wait(timeout=200.0)
    finally:
        process.kill()
        process.wait()
    assert told(robot)[-1] == 0.0
    assert read_streams(tmp_path / "bag")["/left/bridge/command"].effort.size > COMMANDS
