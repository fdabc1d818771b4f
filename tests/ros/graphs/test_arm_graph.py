"""A MuJoCo arm of six joints that follows planned motions through the bridge, on a live graph.

How soon it rests after a fault is measured by ``benchmarks/arm_faults.py``, and kept in simulated time by
test_trajectory_gate.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
pytest.importorskip("mujoco", reason="no MuJoCo: pip install mujoco")

from arm_graph import ACCELERATION, BENCHMARKS, URDF, ArmGraph

from idloop.graph.command import node_environment

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph, pytest.mark.slow]


@pytest.fixture
def graph(tmp_path, ros_environment):
    one = ArmGraph(tmp_path)
    try:
        yield one
    finally:
        one.stop()


def test_whoever_dies_or_hangs_the_arm_comes_to_rest_within_its_acceleration(graph):
    graph.until_moving()
    graph.until_rest_after(graph.signal("guardian", signal.SIGKILL))
    graph.start("guardian")
    graph.until_moving()  # it goes on by itself, along its path
    graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGSTOP))
    graph.signal("trajectory_bridge", signal.SIGCONT)
    graph.until_moving()
    graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGKILL))
    assert graph.largest_acceleration() < ACCELERATION


def test_when_bridge_and_guardian_are_gone_at_once_the_arm_comes_to_rest_by_itself(graph):
    graph.until_moving()
    graph.signal("guardian", signal.SIGKILL)
    graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGKILL))
    assert graph.largest_acceleration() < ACCELERATION


def idloop(*words):
    done = subprocess.run(
        [sys.executable, "-m", "idloop", *map(str, words)],
        env=node_environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_an_arm_is_excited_recorded_identified_and_judged_on_a_motion_that_no_fit_has_seen(tmp_path, ros_environment):
    pytest.importorskip("pinocchio", reason="no Pinocchio: pip install 'idloop[robot]'")
    for name, seed in (("arm1", 0), ("arm2", 1)):
        planned = tmp_path / f"{name}.yaml"
        idloop("robot", "excite", URDF, "--max-acceleration", 6, "--seed", seed, "--output", planned, "--quiet")
        robot = subprocess.Popen(
            [sys.executable, str(BENCHMARKS / "arm_robot.py"), "--seed", str(seed)], env=node_environment()
        )
        try:
            idloop(
                "launch", "arm", f"trajectory:={planned}", f"urdf:={URDF}", "approach:=2.0", f"bag:={tmp_path / name}"
            )
        finally:
            robot.send_signal(signal.SIGINT)
            robot.wait(timeout=60)
    found = json.loads(
        idloop(
            "robot",
            URDF,
            tmp_path / "arm1",
            "--validate",
            tmp_path / "arm2",
            "--topic",
            "/joint_states",
            "--json",
            "--quiet",
        )
    )
    joints = {one["name"]: one for one in found["joints"]}
    added = {name: [step["effect"] for step in one["added"]] for name, one in joints.items()}
    hidden = {"elbow": ["cogging@elbow"], "wrist_roll": ["stribeck_friction@wrist_roll"]}
    assert added == {name: hidden.get(name, []) for name in joints}
    for name in hidden:
        # The noise of the effort is left: without the effect the error is several times as large.
        unseen = [error for error in joints[name]["errors"] if error["unseen"]]
        assert unseen
        assert all(error["rms"] < 0.5 * error["rigid_rms"] for error in unseen)
