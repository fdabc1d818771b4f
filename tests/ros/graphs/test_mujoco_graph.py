"""The graph around a MuJoCo machine: recorded like any other, and its file's own values are identified."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
pytest.importorskip("mujoco", reason="no mujoco: pip install mujoco")

from idloop.estimation import fit
from idloop.graph import load_graph, run_graph
from idloop.physics import load_model
from idloop.records import read_record

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
TRUTH = {"axis.inertia": 0.01, "axis.viscous_friction": 0.05, "coulomb_friction@axis.level": 0.15}


@pytest.mark.slow
def test_a_mujoco_machine_is_recorded_and_identified(tmp_path):
    lines: list[str] = []
    values = {"duration": "12.0", "fit_period": "0.0", "auto_diagnose": "false", "bag": str(tmp_path / "bag")}
    graph = load_graph("mujoco", values)
    assert run_graph(graph, say=lambda label, line: lines.append(f"{label}: {line}")), lines
    model = load_model("axis").with_effects(["coulomb_friction@axis"])
    record = read_record(tmp_path / "bag", model)
    assert record.time.size == 6000, lines
    found = fit(model, [record])
    for name, value in TRUTH.items():
        one = found.model.parameter(name)
        assert abs(one.value - value) < 4.0 * one.stderr, (name, one)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "parameter mjcf"),
        (["-p", "mjcf:=nowhere.xml"], "nowhere.xml: no such MJCF file"),
        (["-p", "mjcf:=nowhere.xml", "-p", "joints:=['a', 'b']"], "2 names for axis"),
    ],
)
def test_a_machine_that_is_not_there_is_one_line_and_exit_code_2(words, said):
    arguments = [sys.executable, "-m", "idloop_nodes", "mujoco_plant", "--ros-args", *words]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
