"""The workspace built by colcon, as in a normal ROS 2: scripts and files lie where `ros2` looks, and they run."""

from __future__ import annotations

import importlib.util
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph.command import node_environment
from idloop_nodes.descriptions import KINDS

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(importlib.util.find_spec("colcon_core") is None, reason="no colcon: run launch_scripts/test"),
    pytest.mark.usefixtures("ros_environment"),
]  # fmt: skip

WORKSPACE = Path(__file__).parents[2] / "ros_ws" / "src"
WAIT = 200.0


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The workspace's install folder."""
    folder = tmp_path_factory.mktemp("workspace")
    words = ["--log-base", "log", "build", "--base-paths", str(WORKSPACE), "--event-handlers", "console_direct+"]
    built = subprocess.run(
        [sys.executable, "-m", "colcon", *words],
        cwd=folder, env=dict(os.environ), check=False, capture_output=True, text=True, timeout=WAIT,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    return folder / "install"


def sourced(installed, command):
    """A shell command in the workspace's environment."""
    setup = shlex.quote(str(installed / "local_setup.bash"))
    return ["bash", "-c", f"source {setup} && exec {command}"]


def test_every_script_lies_where_ros2_run_looks(installed):
    folder = installed / "idloop_nodes" / "lib" / "idloop_nodes"
    assert sorted(one.name for one in folder.iterdir()) == list(KINDS)
    assert all(os.access(one, os.X_OK) for one in folder.iterdir())


def test_launch_files_and_configurations_lie_where_ros2_launch_looks(installed):
    share, source = installed / "idloop_bringup" / "share" / "idloop_bringup", WORKSPACE / "idloop_bringup"
    for kind in ("launch", "config"):
        assert {one.name for one in (share / kind).iterdir()} == {one.name for one in (source / kind).iterdir()}
    for package in ("idloop_nodes", "idloop_bringup"):
        marker = installed / package / "share" / "ament_index" / "resource_index" / "packages" / package
        assert marker.is_file(), "ros2 pkg would not find it"


@pytest.mark.slow
def test_a_script_runs_what_was_built_and_ends_cleanly(installed):
    script = installed / "idloop_nodes" / "lib" / "idloop_nodes" / "plant"
    where = subprocess.run(
        sourced(installed, f"{shlex.quote(sys.executable)} -c 'import idloop_nodes; print(idloop_nodes.__file__)'"),
        env=node_environment(None), capture_output=True, text=True, timeout=WAIT, check=True,
    )  # fmt: skip
    assert Path(where.stdout.strip()).is_relative_to(installed)
    command = f"{shlex.quote(str(script))} --ros-args -p model:=dc_motor"
    with subprocess.Popen(
        sourced(installed, command), env=node_environment(None), stderr=subprocess.PIPE, text=True
    ) as node:
        deadline = time.monotonic() + WAIT
        assert node.stderr is not None
        said = ""
        while "ready: dc_motor" not in said:
            assert time.monotonic() < deadline
            line = node.stderr.readline()
            assert line, said
            said += line
        node.send_signal(signal.SIGINT)
        node.communicate(timeout=WAIT)
        assert node.returncode == 0, said
