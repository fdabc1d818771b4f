"""The estimator's services and the parameter `effects`, on a machine whose samples the test sends."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.physics import Plant, load_model
from idloop.signals import build_signal
from idloop_nodes.codec import (
    JointSample,
    decode_diagnostics,
    decode_joint_state,
    encode_joint_state,
    evidence_from_statuses,
    ladder_from_statuses,
    missing_from_statuses,
)
from idloop_nodes.workbench_page.reading import ladder_of

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.usefixtures("ros_environment"),
]
STEP = 10_000_000
WIDTH = 0.4
READ = {"missing_effects": (missing_from_statuses, "missing"), "ladder": (ladder_from_statuses, "ladder")}


class EstimatorBench:
    """An estimator of the plain motor; the motor that it hears has a dead zone."""

    def __init__(self, bench, **parameters):
        self.bench = bench(
            "estimator",
            **{"model": "dc_motor", "sample_time": 0.01, "mode": "realtime", "fit_period": 0.0}
            | {"diagnose_window": 12.0, "validation": 4.0, "window": 8.0}
            | {"catalogue": "[dead_zone, coulomb_friction, input_offset]"}
            | parameters,
        )
        for name in ("missing_effects", "evidence", "ladder", "prediction", "fit"):
            self.bench.listen(f"estimator/{name}")
        self.commands, self.states = self.bench.talk("joint_command"), self.bench.talk("joint_states")
        self.bench.matched(self.commands, self.states)
        self.bench.until(self.bench.node.publishers_by_topic["estimator/prediction"].get_subscription_count)

    def drive(self, seconds=16.0, seed=1):
        model = load_model("dc_motor").with_effects([f"dead_zone@input(width={WIDTH})"])
        plant = Plant(model, seed=seed)
        signal = build_signal("multilevel", sample_time=0.01, duration=seconds, amplitude=3.0, seed=seed)
        for index, command in enumerate(signal.value.tolist()):
            stamp = 10**9 + index * STEP
            position, velocity = plant.measure().tolist()
            self.commands.publish(encode_joint_state(JointSample(stamp, ("motor",), effort=(command,))))
            self.states.publish(encode_joint_state(JointSample(stamp, ("motor",), (position,), (velocity,))))
            plant.step(command, (index + 1) * 0.01)
            if index % 50 == 49:
                self.bench.until(lambda stamp=stamp: self.bench.node.estimator.input.last == stamp)

    def call(self, name):
        return self.bench.call(f"/estimator/{name}")

    def after(self, topic, order):
        """Give an order and wait until the topic says what it brought."""
        coordinator = self.bench.node.estimator.diagnosis.coordinator
        read, name = READ[topic]
        got = self.bench.got[f"estimator/{topic}"]
        old = getattr(coordinator, name)
        answer = order()
        self.bench.until(lambda: not coordinator.busy and getattr(coordinator, name) is not old)
        self.bench.until(lambda: got and read(decode_diagnostics(got[-1])[1]) == getattr(coordinator, name))
        newest = getattr(coordinator, name)
        return answer, ladder_of(newest, None) if topic == "ladder" else newest

    def effects(self):
        return [one for one in self.bench.node.get_parameter("effects").value if one]


@pytest.mark.slow
def test_orders_climb_the_ladder_and_come_down_again(bench):
    one = EstimatorBench(bench)
    assert "no samples" in one.call("diagnose").message
    one.drive()
    refusals = {"add_best_effect": "diagnose first", "undo": "no step", "run_suggested_experiment": "diagnose first"}
    for name, said in refusals.items():
        answer = one.call(name)
        assert not answer.success
        assert said in answer.message

    answer, missing = one.after("missing_effects", lambda: one.call("diagnose"))
    assert answer.success
    assert "16.0 s of data" in answer.message
    assert missing.verdict == "missing"
    assert missing.set == ("dead_zone@input",)
    best = missing.document["candidates"][0]
    assert best["p_value"] < 0.01
    assert abs(best["parameters"]["width"]["value"] - WIDTH) < 0.05
    assert best["parameters"]["width"]["unit"] == "V"
    assert missing.where
    assert missing.document["gate"]["findings"]

    _, ladder = one.after("ladder", lambda: one.call("add_best_effect"))
    assert [step.added.name for step in ladder.steps[1:]] == ["dead_zone@input"]
    assert ladder.steps[1].chosen_by == "diagnosis"
    assert ladder.steps[1].p_value == best["p_value"]
    before, after = (step.validation["nrmse"]["motor.position"] for step in ladder.steps)
    assert after < 0.5 * before
    assert one.effects() == ["dead_zone@input"]
    assert "dead_zone@input" in one.bench.node.estimator.model.effect_names

    _, missing = one.after("missing_effects", lambda: one.call("diagnose"))
    assert missing.values["effects"] == "dead_zone@input"
    assert missing.verdict != "missing"
    assert missing.set == ()

    answer, ladder = one.after("ladder", lambda: one.call("undo"))
    assert len(ladder.steps) == 1
    assert "switched off" not in answer.message  # nothing went on by itself
    assert one.effects() == []
    assert one.bench.node.estimator.model.effect_names == ()


@pytest.mark.slow
def test_results_reach_whoever_comes_later(bench):
    one = EstimatorBench(bench)
    one.drive()
    one.after("missing_effects", lambda: one.call("diagnose"))
    one.bench.got.clear()
    for topic in ("estimator/missing_effects", "estimator/ladder"):
        one.bench.listen(topic)
        one.bench.until(lambda topic=topic: one.bench.got[topic])


@pytest.mark.slow
def test_setting_the_effects_refits_with_exactly_these(bench):
    one = EstimatorBench(bench)
    one.drive()
    text = "coulomb_friction@motor(level=0.5)"
    _, ladder = one.after("ladder", lambda: one.bench.set("effects", [text]))
    assert [step.added.name for step in ladder.steps[1:]] == ["coulomb_friction@motor"]
    assert ladder.steps[1].chosen_by == "user"
    assert one.effects() == ["coulomb_friction@motor"]
    one.bench.until(lambda: one.bench.got["estimator/fit"])

    both = ["coulomb_friction@motor", "dead_zone@input"]
    _, ladder = one.after("ladder", lambda: one.bench.set("effects", both))
    assert [step.added.name for step in ladder.steps[1:]] == both
    assert ladder.steps[2].validation["nrmse"]["motor.position"] < ladder.steps[0].validation["nrmse"]["motor.position"]

    _, ladder = one.after("ladder", lambda: one.bench.set("effects", ["dead_zone@input"]))
    assert [step.added.name for step in ladder.steps[1:]] == ["dead_zone@input"]

    refused = one.bench.set("effects", ["dead_zone@inptu"])
    assert not refused.successful
    assert "inptu" in refused.reason
    assert "\n" not in refused.reason
    assert one.effects() == ["dead_zone@input"]


@pytest.mark.slow
def test_a_diagnosis_delays_no_sample(bench):
    """Every sample that comes in while the worker diagnoses is predicted before the diagnosis is there."""
    one = EstimatorBench(bench)
    one.drive()
    seen = len(one.bench.got["estimator/prediction"])
    assert one.call("diagnose").success
    last = one.bench.node.estimator.input.last
    count = 0
    while not one.bench.got["estimator/missing_effects"]:
        count += 1
        stamp = last + count * STEP
        one.commands.publish(encode_joint_state(JointSample(stamp, ("motor",), effort=(0.0,))))
        one.states.publish(encode_joint_state(JointSample(stamp, ("motor",), (0.0,), (0.0,))))
        one.bench.until(lambda: len(one.bench.got["estimator/prediction"]) >= seen + count)  # noqa: B023
    stamps = [decode_joint_state(data).stamp_ns for data in one.bench.got["estimator/prediction"]]
    assert count > 20
    assert np.array_equal(np.diff(stamps), np.full(len(stamps) - 1, STEP))


@pytest.mark.slow
def test_a_residual_that_is_not_white_is_diagnosed_unasked(bench):
    one = EstimatorBench(bench, fit_period=1.0)
    one.drive()
    one.bench.until(lambda: one.bench.got["estimator/missing_effects"])
    _, statuses = decode_diagnostics(one.bench.got["estimator/missing_effects"][0])
    assert missing_from_statuses(statuses).set == ("dead_zone@input",)


@pytest.mark.slow
def test_what_the_user_takes_back_is_not_added_again(bench):
    one = EstimatorBench(bench, auto_add=True, auto_experiment=True, fit_period=1.0)
    one.drive()
    one.bench.until(lambda: one.effects() == ["dead_zone@input"])
    # What was added is diagnosed again, and nothing is left.
    one.bench.until(lambda: one.bench.node.estimator.diagnosis.coordinator.missing is not None)
    one.bench.until(lambda: not one.bench.node.estimator.diagnosis.coordinator.busy)
    assert one.bench.node.estimator.diagnosis.health().values["automatic"] == "diagnose add experiment"
    answer, _ = one.after("ladder", lambda: one.call("undo"))
    assert "auto_add and auto_experiment switched off" in answer.message
    assert one.bench.node.estimator.diagnosis.health().values["automatic"] == "diagnose"
    _, missing = one.after("missing_effects", lambda: one.call("diagnose"))
    assert missing.set == ("dead_zone@input",)
    one.bench.until(lambda: not one.bench.node.estimator.diagnosis.coordinator.busy)
    assert one.effects() == []


@pytest.mark.slow
def test_the_evidence_rises_with_the_samples_and_ends_the_experiment_if_asked(bench):
    from std_srvs.srv import Trigger

    one = EstimatorBench(bench, evidence_period=3.0, auto_diagnose=False, mode="lockstep", end_when_decided=True)
    stopped = []

    def stop(service):
        def answer(request, response):
            stopped.append(service)
            response.success = True
            return response

        one.bench.other.create_service(Trigger, service, answer)

    services = ["/controller/emergency_stop", "/excitation/stop"]
    for service in services:
        stop(service)
    one.drive(22.5)
    one.bench.until(lambda: len(stopped) == 2 and not one.bench.node.estimator._evidence.busy)
    assert sorted(stopped) == services
    looks = [evidence_from_statuses(decode_diagnostics(data)[1]) for data in one.bench.got["estimator/evidence"]]
    found = [effect for summary in looks for effect in summary.candidates if effect.name == "dead_zone@input"]
    assert len(found) >= 2
    assert np.all(np.diff([effect.log_e for effect in found]) > 0.0)
    assert found[-1].log_e > looks[-1].threshold
    assert found[-1].decided_stamp == looks[-1].stamp
    assert found[-1].decided_samples == looks[-1].samples == 300 * looks[-1].looks
    assert [bool(summary.ended) for summary in looks] == [False] * (len(looks) - 1) + [True]


@pytest.mark.slow
def test_an_excitation_that_is_not_there_is_said(bench, monkeypatch):
    monkeypatch.setattr("idloop_nodes.service_calls.EXPERIMENT_TIMEOUT", 0.5)
    one = EstimatorBench(bench, catalogue="[dead_zone]")
    one.drive()
    one.after("missing_effects", lambda: one.call("diagnose"))
    answer, ladder = one.after("ladder", lambda: one.call("run_suggested_experiment"))
    assert answer.success
    assert "excitation/get_parameters does not answer" in ladder.error
