"""The recursive black-box model beside the prediction: what it publishes is what the library finds offline."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.estimation.black_box.sampled import sampled
from idloop.estimation.recursive import RECURSIVE_METHODS, LiveRecursion, recursive_estimator, track
from idloop.estimation.recursive.methods import orders_of
from idloop.physics import Plant, load_model
from idloop.records import Record
from idloop.signals import build_signal
from idloop_nodes.codec import JointSample, decode_diagnostics, decode_joint_state, encode_joint_state
from idloop_nodes.descriptions import describe

STEP = 10_000_000
COUNT = 600


def test_the_parameter_knows_every_recursive_method():
    (spec,) = (one for one in describe("estimator").parameters() if one.name == "recursion")
    assert set(spec.choices) == {"none", *RECURSIVE_METHODS}


def motor_samples():
    """Commands and measurements of a motor with a dead zone."""
    plant = Plant(load_model("dc_motor").with_effects(["dead_zone@input(width=0.4)"]), seed=3)
    command = build_signal("multilevel", sample_time=0.01, duration=COUNT * 0.01, amplitude=3.0, seed=3).value[:COUNT]
    measured = np.empty((COUNT, 2))
    for k, value in enumerate(command):
        measured[k] = plant.measure()
        plant.step(float(value), (k + 1) * 0.01)
    return np.asarray(command), measured


class Followed:
    """An estimator node that has heard some samples."""

    def __init__(self, bench, command, measured, lost=(), **parameters):
        self.bench = bench(
            "estimator",
            **{"model": "dc_motor", "sample_time": 0.01, "mode": "realtime", "fit_period": 0.0}
            | {"auto_diagnose": False, "recursion": "rarmax", "recursion_period": 1.0}
            | parameters,
        )
        for name in ("innovation", "coefficients"):
            self.bench.listen(f"estimator/{name}")
        commands, states = self.bench.talk("joint_command"), self.bench.talk("joint_states")
        self.bench.matched(commands, states)
        for name in ("innovation", "coefficients"):
            self.bench.until(self.bench.node.publishers_by_topic[f"estimator/{name}"].get_subscription_count)
        self.stamps = [10**9 + k * STEP for k in range(len(command)) if k not in lost]
        for k, (u, (position, velocity)) in enumerate(zip(command.tolist(), measured.tolist(), strict=True)):
            stamp = 10**9 + k * STEP
            commands.publish(encode_joint_state(JointSample(stamp, ("motor",), effort=(u,))))
            if k not in lost:
                states.publish(encode_joint_state(JointSample(stamp, ("motor",), (position,), (velocity,))))
            if k % 50 == 49:
                self.bench.until(lambda stamp=stamp: self.bench.node.estimator.input.last == stamp)

    def innovations(self):
        got = self.bench.got["estimator/innovation"]
        self.bench.until(lambda: len(got) == len(self.stamps))
        samples = [decode_joint_state(data) for data in got]
        assert [one.stamp_ns for one in samples] == self.stamps
        return np.array([[*one.position, *one.velocity] for one in samples])

    def coefficients(self, index):
        """What was told after a sample; latched messages that come close together replace each other."""
        got = self.bench.got["estimator/coefficients"]
        self.bench.until(lambda: got and decode_diagnostics(got[-1])[0] == 10**9 + index * STEP)
        return [one.values for one in decode_diagnostics(got[-1])[1]]


@pytest.mark.ros
@pytest.mark.usefixtures("ros_environment")
@pytest.mark.parametrize("method", ["rarx", "rarmax", "ekf"])
def test_a_stream_gives_what_the_record_gives_offline(method, bench):
    command, measured = motor_samples()
    online = Followed(bench, command, measured, recursion=method)
    time = 0.01 * np.arange(COUNT)
    record = Record(
        name="motor", input_time=time, input=command, time=time, output=measured, input_name="u", input_unit="V",
        output_names=("motor.position", "motor.velocity"), output_units=("rad", "rad/s"),
    )  # fmt: skip
    (data,) = sampled(record)
    orders = orders_of(method, 2, 1)
    histories = [track(recursive_estimator(method, orders, sample_time=0.01), data.outputs([i])) for i in (0, 1)]
    np.testing.assert_allclose(online.innovations(), np.column_stack([h.innovations for h in histories]), atol=1e-12)
    found = online.coefficients(500)
    for one, history in zip(found, histories, strict=True):
        assert one["samples"] == "501"
        for kind, expected in (("value", history.values), ("stderr", history.stderr)):
            told = [float(text) for key, text in one.items() if key.startswith(f"{kind}/")]
            np.testing.assert_allclose(told, expected[500], rtol=1e-9)
    assert [one["unit"] for one in found] == ["rad", "rad/s"]


@pytest.mark.ros
@pytest.mark.usefixtures("ros_environment")
def test_missing_measurements_and_lost_messages_are_lived_through(bench):
    command, measured = motor_samples()
    measured[100:110, 0] = np.nan
    measured[200:220, 1] = np.nan
    lost = {301, 302, 303}
    online = Followed(bench, command, measured, lost)
    left = online.innovations()
    found = online.coefficients(500)
    kept = np.array([k for k in range(COUNT) if k not in lost])
    assert np.all(np.isnan(left[100:110, 0]))
    assert np.all(np.isnan(left[200:220, 1]))
    assert np.isfinite(left).sum() == 2 * len(kept) - 30
    offline = LiveRecursion("rarmax", ("motor.position", "motor.velocity"), sample_time=0.01)
    expected = offline.update_block(0.01 * kept, command[kept], measured[kept])
    np.testing.assert_allclose(left, expected, atol=1e-12)
    assert [int(one["samples"]) for one in found] == [501 - 13, 501 - 23]
    health = {status.name: status for status in online.bench.node.health()}
    assert health["recursion"].values["holes"] == "0"


@pytest.mark.ros
@pytest.mark.usefixtures("ros_environment")
def test_without_the_parameter_nothing_is_followed(bench):
    command, measured = motor_samples()
    online = Followed(bench, command[:100], measured[:100], recursion="none")
    assert online.bench.got["estimator/innovation"] == []
    assert "recursion" not in {status.name for status in online.bench.node.health()}


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("ros_environment")
def test_a_replayed_bag_gives_what_was_seen_live_and_what_the_record_gives(tmp_path):
    from rosbags.highlevel import AnyReader

    from idloop.graph import load_graph, run_graph
    from idloop.records import read_record

    def innovations(bag):
        with AnyReader([bag]) as reader:
            given = [(c.topic, bytes(data)) for c, _, data in reader.messages()]
        return [data for topic, data in given if topic == "/estimator/innovation"]

    common = {
        "window": "2.0",
        "validation": "1.0",
        "fit_period": "0.0",
        "auto_diagnose": "false",
        "recursion": "rarmax",
    }
    live, again = tmp_path / "live", tmp_path / "again"
    values = {"duration": "4.0", "bag": str(live), **common}
    graph = load_graph("dc_motor", values)
    assert run_graph(graph, say=lambda label, line: None)
    values = {"play": str(live), "bag": str(again), "sample_time": "0.01", **common}
    graph = load_graph("replay", values)
    assert run_graph(graph, say=lambda label, line: None)
    seen = innovations(live)
    assert len(seen) == 400
    assert innovations(again) == seen
    (data,) = sampled(read_record(again, load_model("dc_motor")))
    expected = np.column_stack(
        [
            track(
                recursive_estimator("rarmax", orders_of("rarmax", 2, 1), sample_time=0.01), data.outputs([i])
            ).innovations
            for i in (0, 1)
        ]
    )
    samples = [decode_joint_state(one) for one in seen]
    got = np.array([[*one.position, *one.velocity] for one in samples])
    np.testing.assert_allclose(got, expected, atol=1e-9)
