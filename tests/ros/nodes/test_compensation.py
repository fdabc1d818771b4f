"""Compensation on the nodes: the controller cancels what its fitted model has, and a machine follows better for it."""

from __future__ import annotations

import json
import math

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.cli import main
from idloop.errors import InputError
from idloop.estimation import fit
from idloop.graph import load_graph, run_graph
from idloop.graph.find import package_share
from idloop.physics import load_model
from idloop.records import read_record
from idloop_nodes.codec import JointSample, decode_joint_state, encode_joint_state

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
MS = 1_000_000
LAW = "'{type: p, output: motor.position, kp: 2.0}'"


@pytest.fixture
def fitted(tmp_path):
    path = tmp_path / "fitted.yaml"
    effects = ["dead_zone@input(width=0.5)", "input_offset@input(offset=0.1)", "saturation@input(limit=9.0)"]
    load_model("dc_motor").with_effects(effects).save(path)
    return path


class Loop:
    def __init__(self, bench, **parameters):
        self.bench = bench("controller", model="dc_motor", sample_time=0.01, controller=LAW, **parameters)
        self.bench.listen("joint_command")
        self.states, self.references = self.bench.talk("joint_states"), self.bench.talk("reference")
        self.bench.matched(self.states, self.references)
        self.bench.until(self.bench.node.publishers_by_topic["joint_command"].get_subscription_count)
        self.stamp = 10**9

    def answer(self, position, wanted):
        self.stamp += 10 * MS
        before = len(self.bench.got["joint_command"])
        self.references.publish(encode_joint_state(JointSample(self.stamp, ("motor",), (wanted,), (0.0,))))
        self.states.publish(encode_joint_state(JointSample(self.stamp, ("motor",), (position,), (0.0,))))
        self.bench.until(lambda: len(self.bench.got["joint_command"]) > before)
        return decode_joint_state(self.bench.got["joint_command"][-1]).effort[0]


def test_the_controller_undoes_what_the_drive_does_to_a_command(bench, fitted):
    one = Loop(bench, compensation=str(fitted))
    assert one.answer(0.0, 1.0) == pytest.approx(2.0 + 0.5 - 0.1)
    assert one.answer(0.0, -1.0) == pytest.approx(-2.0 - 0.5 - 0.1)
    (loop, _) = one.bench.node.health()
    assert loop.values["cancels"] == "dead_zone@input, input_offset@input"


def test_chosen_effects_within_a_limit(bench, fitted):
    one = Loop(bench, compensation=str(fitted), compensation_effects="['dead_zone']", compensation_limit=0.3)
    assert one.answer(0.0, 1.0) == pytest.approx(2.3)


def test_a_stop_and_a_fault_are_zero_with_compensation_as_well(bench, fitted):
    one = Loop(bench, compensation=str(fitted))
    assert one.bench.call("/controller/emergency_stop").success
    assert one.answer(0.0, 1.0) == 0.0
    assert one.bench.call("/controller/reset").success
    assert one.answer(math.nan, 1.0) == 0.0
    one.bench.node.trigger_deactivate()
    assert one.answer(0.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"compensation": "nowhere.yaml"}, "nowhere.yaml"),
        ({"compensation": "torsion", "compensation_effects": "['dead_zone']"}, "no effect 'dead_zone'"),
        ({"compensation": "axis"}, "no output of model axis"),
    ],
)
def test_what_cannot_be_cancelled_is_one_line(bench, parameters, said):
    with pytest.raises(InputError, match=said) as caught:
        bench("controller", model="dc_motor", controller=LAW, **parameters)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_mujoco_machine_is_recorded_identified_and_then_follows_twice_as_well(tmp_path, ros_domain_id, capsys):
    pytest.importorskip("mujoco", reason="no mujoco: pip install mujoco")
    lines: list[str] = []
    values = {"duration": "8.0", "fit_period": "0.0", "auto_diagnose": "false", "bag": str(tmp_path / "bag")}
    assert run_graph(load_graph("mujoco", values), say=lambda label, line: lines.append(f"{label}: {line}")), lines
    model = load_model("axis").with_effects(["coulomb_friction@axis"])
    known = tmp_path / "fitted.yaml"
    fit(model, [read_record(tmp_path / "bag", model)]).model.save(known)
    mjcf = package_share("idloop_bringup") / "config" / "mujoco_axis.xml"
    law = (
        "{type: pd, output: axis.position, kp: 4.0, kd: 0.3, velocity_feedforward: 0.3, limit: 2.0, sample_time: 0.002}"
    )
    reference = "{name: smooth, points: [1.0, -1.0], velocity_limit: 1.0, acceleration_limit: 10.0, duration: 6.0}"
    words = ["compensate", str(known), "--plant", str(mjcf), "--controller", law, "--reference", reference, "--json"]
    capsys.readouterr()
    assert main.run([*words, "--graph", "--bags", str(tmp_path / "bags"), "--domain", str(ros_domain_id)]) == 0
    on_graph = json.loads(capsys.readouterr().out)["errors"]["axis.position"]
    assert on_graph["ratio"] <= 0.5
    assert {path.name for path in (tmp_path / "bags").iterdir()} == {"without", "with"}
    # The nodes do what the simulation says, but for another draw of the noise.
    assert main.run(words) == 0
    simulated = json.loads(capsys.readouterr().out)["errors"]["axis.position"]
    assert on_graph["without"]["rms"] == pytest.approx(simulated["without"]["rms"], rel=0.01)
    assert on_graph["with"]["rms"] == pytest.approx(simulated["with"]["rms"], rel=0.02)
