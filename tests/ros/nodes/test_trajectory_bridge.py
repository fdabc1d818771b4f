"""The bridge to a joint_trajectory_controller, one node in one process."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.errors import InputError
from idloop.robots.excitation import Trajectory, trajectory_text
from idloop_nodes import qos
from idloop_nodes.codec import (
    JointSample,
    decode_diagnostics,
    decode_joint_state,
    decode_trajectory,
    encode_joint_state,
)

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
MS = 1_000_000
JOINTS = ("shoulder", "elbow")
ROBOT, COMMANDS = "/robot/joint_states", "/robot/trajectory"
URDF = """<robot name="two">
  <joint name="shoulder" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
  <joint name="elbow" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
</robot>
"""


@pytest.fixture
def files(tmp_path):
    """Parameters of the bridge: a URDF, and a motion of both joints from 0 to 0.4 and back."""
    time_ = np.linspace(0.0, 2.0, 101)
    position = 0.2 * np.outer(1.0 - np.cos(np.pi * time_), [1.0, -1.0])
    velocity = 0.2 * np.pi * np.outer(np.sin(np.pi * time_), [1.0, -1.0])
    planned = Trajectory(JOINTS, time_, position, velocity, 0.0 * position, 1.0, 1.0, 1.0, ())
    (tmp_path / "t.csv").write_text(trajectory_text(planned, "csv"), encoding="utf-8")
    (tmp_path / "r.urdf").write_text(URDF, encoding="utf-8")
    # Nothing here depends on how fast this machine is: silence is tested where the tests tell the time.
    return {
        "trajectory": tmp_path / "t.csv", "urdf": tmp_path / "r.urdf", "limit.acceleration": 9.0, "watchdog": 10.0,
        "require_guardian": False, "robot_states": ROBOT, "robot_commands": COMMANDS,
    }  # fmt: skip


class ArmBench:
    """The bridge, and an arm that is always where it was told to be last."""

    def __init__(self, bench, files, **parameters):
        from sensor_msgs.msg import JointState
        from trajectory_msgs.msg import JointTrajectory

        self.bench = bench("trajectory_bridge", **(files | parameters))
        self.received = []
        other = self.bench.other
        self.robot = other.create_publisher(JointState, ROBOT, qos.stream())
        other.create_subscription(JointTrajectory, COMMANDS, self.received.append, qos.stream(), raw=True)
        for topic in ("bridge/command", "/diagnostics"):
            self.bench.listen(topic)
        self.bench.matched(self.robot)
        self.bench.until(self.bench.node._to_robot.get_subscription_count)

    @property
    def gate(self):
        return self.bench.node._gate

    def measure(self, names=("gripper", "elbow", "shoulder"), **spoilt):
        told = self.gate.planned(time.monotonic_ns())
        where = dict(zip(JOINTS, told[0] if told else (0.0, 0.0), strict=True)) | spoilt
        row = tuple(where.get(name, 0.0) for name in names)
        before = self.bench.node.counters.measured.count
        self.robot.publish(encode_joint_state(JointSample(time.time_ns(), names, row, (0.0,) * len(row))))
        if set(names) & set(JOINTS):
            self.bench.until(lambda: self.bench.node.counters.measured.count > before)

    def until(self, condition, **spoilt):
        """Measure until something is so."""

        def turned():
            self.measure(**spoilt)
            return condition()

        self.bench.until(turned)

    def newest(self):
        return decode_trajectory(self.received[-1])


def test_the_motion_is_sent_in_pieces_that_end_at_rest_and_the_node_ends_with_it(bench, files):
    one = ArmBench(bench, files)
    one.until(lambda: one.bench.node.finished)
    pieces = [decode_trajectory(data) for data in one.received]
    assert {names for _, names, _ in pieces} == {JOINTS}
    assert all(points[-1].velocity == (0.0, 0.0) for _, _, points in pieces)
    stamps = [stamp for stamp, _, _ in pieces]
    assert stamps == sorted(stamps)
    assert max(points[0].position[0] for _, _, points in pieces) == pytest.approx(0.4, abs=0.01)
    one.bench.until(lambda: one.bench.got["bridge/command"])
    sample = decode_joint_state(one.bench.got["bridge/command"][-1])
    assert sample.names == JOINTS
    assert len(sample.position) == len(sample.velocity) == 2


def test_what_is_not_a_number_brings_it_to_rest_and_the_next_measurement_lets_it_go(bench, files):
    one = ArmBench(bench, files)
    one.until(lambda: one.gate.share_done > 0.3)
    one.measure(elbow=math.nan)
    assert one.gate.reason == "the position of elbow is not finite"
    one.until(lambda: one.gate.neutral_command(time.monotonic_ns()) is None, elbow=math.nan)
    rest = one.newest()[2][-1]
    assert rest.velocity == (0.0, 0.0)
    one.until(lambda: one.gate.share_done > 0.5)


def test_a_message_of_another_part_of_the_robot_is_none_of_ours_and_one_without_a_joint_stops(bench, files):
    one = ArmBench(bench, files)
    one.measure()
    one.measure(names=("gripper",))
    one.measure(names=("shoulder",))
    one.bench.until(lambda: one.gate.reason == "the position of elbow is not finite")
    text = f"no joint elbow in {ROBOT}: shoulder"

    def said():
        found = [decode_diagnostics(data)[1] for data in one.bench.got["/diagnostics"]]
        return text in {status.message for statuses in found for status in statuses}

    one.bench.until(said)


def test_after_a_pause_only_the_newest_measurement_counts(bench, files):
    """Those that have waited say where the arm was: compared with where it is told to be now, it would be lost."""
    one = ArmBench(bench, files)
    from rclpy.duration import Duration

    one.measure()
    one.until(lambda: one.gate.share_done and one.gate.planned(time.monotonic_ns())[0][0] > 0.25)
    for share in (*[0.0] * 50, 1.0):
        position = tuple(share * one.gate.planned(time.monotonic_ns())[0])
        one.robot.publish(encode_joint_state(JointSample(time.time_ns(), JOINTS, position, (0.0, 0.0))))
    assert one.robot.wait_for_all_acked(Duration(seconds=60))
    one.until(lambda: one.gate.share_done > 0.9)
    assert not one.gate.latched


def test_the_emergency_stop_is_a_service(bench, files):
    one = ArmBench(bench, files)
    one.until(lambda: one.gate.share_done > 0.3)
    assert one.bench.call("/trajectory_bridge/emergency_stop").success
    one.until(lambda: one.gate.neutral_command(time.monotonic_ns()) is None)
    where = one.gate.share_done
    assert one.gate.latched == "emergency stop"
    assert one.bench.call("/trajectory_bridge/reset").success
    one.until(lambda: one.gate.share_done > where)


def test_another_publisher_of_trajectories_stops_it(bench, files):
    from trajectory_msgs.msg import JointTrajectory

    one = ArmBench(bench, files)
    one.until(lambda: one.gate.share_done > 0.1)
    one.bench.other.create_publisher(JointTrajectory, COMMANDS, 1)
    one.until(lambda: "others publish on /robot/trajectory, past all limits: /bench" in one.gate.reason)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"trajectory": "''"}, "trajectory is not set"),
        ({"urdf": "''"}, "urdf is not set"),
        ({"limit.acceleration": 2.0}, r"t\.csv: the trajectory needs an acceleration of"),
        ({"trajectory": "nowhere.yaml"}, r"nowhere\.yaml: No such file"),
    ],
)
def test_what_cannot_work_is_one_line(bench, files, given, said):
    with pytest.raises(InputError, match=said) as caught:
        bench("trajectory_bridge", **(files | given))
    assert "\n" not in str(caught.value)


def test_without_an_acceleration_it_does_not_start(bench, files):
    del files["limit.acceleration"]
    with pytest.raises(InputError, match=r"limit\.acceleration is not set"):
        bench("trajectory_bridge", **files)


def test_the_example_has_parameters_of_the_node():
    from idloop.graph import load_graph
    from idloop_nodes.descriptions import describe

    graph = load_graph("arm", {"namespace": "left"})
    assert {node.namespace for node in graph.nodes} == {"left"}
    assert [node.executable for node in graph.nodes if node.ends_graph] == ["trajectory_bridge"]
    (file,) = {file for node in graph.nodes for file in node.parameter_files}
    text = Path(file).read_text(encoding="utf-8")
    known = {spec.name for spec in describe("trajectory_bridge").parameters()}
    section = text.split("/**/trajectory_bridge:")[1].split("/**/")[0].split("ros__parameters:")[1]
    names = {line.split(":")[0].strip() for line in section.splitlines() if line.strip()}
    assert names
    assert names <= known
