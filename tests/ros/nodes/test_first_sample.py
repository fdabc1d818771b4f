"""Nothing follows the first sample before every listener has it; who hears nothing subscribes again."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from hypothesis import given
from hypothesis import strategies as st

from idloop_nodes.codec import JointSample, decode_header, decode_joint_state, encode_header, encode_joint_state
from idloop_nodes.progress import REPORT_EVERY, BackPressure, due

PERIOD = 10_000_000  # ns

pytestmark = pytest.mark.ros


@given(st.integers(0, 10**12), st.integers(1, 2 * REPORT_EVERY), st.sampled_from([1, PERIOD, 10**9]))
def test_a_listener_tells_often_enough_for_the_smallest_window(start, burst, period):
    window = BackPressure(["recorder"], REPORT_EVERY * period, first_alone=True)
    told, sent, reached = None, -1, -1
    for _ in range(5 * REPORT_EVERY):
        while sent < reached + burst and window.open(start + (sent + 1) * period, start):
            sent += 1
        assert sent > reached, "nobody moves any more"
        reached = sent
        if due(told, start + reached * period, period):
            told = start + reached * period
            window.progress.update(told, "recorder")


def test_the_first_sample_stays_alone_until_all_have_it():
    window = BackPressure(["recorder", "estimator"], 100 * PERIOD, first_alone=True)
    assert window.open(0, start=0)
    window.progress.update(0, "recorder")
    assert not window.open(PERIOD, start=0)
    assert window.slow(PERIOD, start=0) == ["estimator"]
    window.progress.update(0, "estimator")
    assert window.open(PERIOD, start=0)
    assert not window.unconfirmed()


def test_a_run_that_begins_again_is_told_of_from_its_first_sample():
    assert due(60 * 10**9, 10**9, PERIOD)
    assert not due(10**9, 10**9, PERIOD)


@pytest.mark.usefixtures("ros_environment")
def test_a_plant_says_the_first_sample_until_every_listener_has_told_of_it(bench, monkeypatch, capfd):
    monkeypatch.setattr("idloop_nodes.nodes.plant.REPEAT", 0.0)
    monkeypatch.setattr("idloop_nodes.nodes.plant.FIRST_TIMEOUT", 0.0)
    one = bench("plant", model="dc_motor", sample_time=0.01, listeners="[late]")
    one.listen("joint_states")
    commands, progress = one.talk("joint_command"), one.talk("progress")
    one.matched(commands, progress)
    one.until(lambda: one.got["joint_states"])
    stamp = decode_joint_state(one.got["joint_states"][0]).stamp_ns
    commands.publish(encode_joint_state(JointSample(stamp, ("motor",), (), (), (1.0,))))
    one.until(lambda: one.node._held_back is not None)
    before = len(one.got["joint_states"])
    one.until(lambda: len(one.got["joint_states"]) > before + 3)
    assert {decode_joint_state(data).stamp_ns for data in one.got["joint_states"]} == {stamp}
    progress.publish(encode_header(stamp, "late"))
    one.until(lambda: decode_joint_state(one.got["joint_states"][-1]).stamp_ns == stamp + PERIOD)
    assert "waits for late at 0.010 s of simulated time, which confirmed no sample yet" in capfd.readouterr().err


@pytest.mark.usefixtures("ros_environment")
def test_a_plant_whose_listener_never_tells_ends_with_a_line(bench, monkeypatch):
    from idloop.errors import IdloopError

    monkeypatch.setattr("idloop_nodes.nodes.plant.RUNNING_PEER_FACTOR", 1.0)
    one = bench("plant", model="dc_motor", sample_time=0.01, listeners="[late]", start_timeout=0.2)
    one.listen("joint_states")
    commands = one.talk("joint_command")
    one.until(lambda: one.got["joint_states"])
    one.matched(commands)
    stamp = decode_joint_state(one.got["joint_states"][0]).stamp_ns
    commands.publish(encode_joint_state(JointSample(stamp, ("motor",), (), (), (1.0,))))
    with pytest.raises(IdloopError, match=r"^late confirmed no sample within 0\.2 s; start the graph again$"):
        one.until(lambda: False, wait=60.0)


@pytest.mark.usefixtures("ros_environment")
@pytest.mark.parametrize("kind", ["estimator", "recorder"])
def test_a_listener_that_hears_nothing_of_a_run_subscribes_again(bench, monkeypatch, tmp_path, capfd, kind):
    monkeypatch.setattr("idloop_nodes.base.NO_MESSAGES", 0.0)
    own = {"recorder": {"bag": str(tmp_path / "bag")}, "estimator": {"model": "dc_motor", "auto_diagnose": False}}
    one = bench(kind, sample_time=0.01, **own[kind])
    one.listen("progress")
    deaf = one.node._streams_by_topic["joint_states"].subscription
    progress = one.talk("progress")
    one.matched(progress)
    progress.publish(encode_header(10**9, "plant"))
    one.until(lambda: one.node._streams_by_topic["joint_states"].subscription is not deaf)
    assert "no message on joint_states since the run began" in capfd.readouterr().err
    states, commands = one.talk("joint_states"), one.talk("joint_command")
    one.matched(states, commands)
    states.publish(encode_joint_state(JointSample(10**9, ("motor",), (0.0,), (0.0,))))
    commands.publish(encode_joint_state(JointSample(10**9, ("motor",), (), (), (1.0,))))
    one.until(lambda: (10**9, kind) in [decode_header(data) for data in one.got["progress"]])
