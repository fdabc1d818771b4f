"""Two graphs in one ROS domain would mix up: the one that comes second ends with a line."""

from __future__ import annotations

import time

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.errors import InputError
from idloop.graph import GraphRun, load_graph, run_graph
from idloop_nodes.codec import decode_header, encode_header, encode_time

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]


def test_a_node_that_meets_another_of_its_name_ends(bench):
    one = bench("plant", model="dc_motor", sample_time=0.01)
    other = one.talk("progress")
    one.matched(other)
    one.until(lambda: one.node.start.ready and one.node.start.duplicate.announcements == 1)
    assert one.node.broken is None
    other.publish(encode_header(0, "plant/ready"))
    one.until(lambda: one.node.broken is not None)
    assert isinstance(one.node.broken, InputError)
    assert "another node /plant runs in ROS domain" in str(one.node.broken)


def test_a_node_that_has_run_for_a_while_goes_on_when_another_comes(bench, monkeypatch):
    monkeypatch.setattr("idloop_nodes.graph_start.NEW", 0.0)
    one = bench("plant", model="dc_motor", sample_time=0.01)
    other = one.talk("progress")
    one.matched(other)
    one.until(lambda: one.node.start.ready and one.node.start.duplicate.announcements == 1)
    other.publish(encode_header(0, "plant/ready"))
    one.until(lambda: one.node.start.duplicate.announcements == 2)
    assert one.node.broken is None


def test_a_node_is_silent_while_another_of_its_name_may_be_there(bench, monkeypatch):
    import rclpy

    monkeypatch.setattr("idloop_nodes.graph_start.NEW", 1e9)
    one = bench("excitation", peers="[bench]", sample_time=0.01)
    namesake = rclpy.create_node("excitation")
    clock = one.talk("/clock")
    one.matched(clock)
    one.listen("reference")
    one.until(lambda: one.node.start.duplicate.known is not None)
    follow, heard = one.node._follow, []
    monkeypatch.setattr(one.node, "_follow", lambda now: heard.append(follow(now)))
    clock.publish(encode_time(10**9))
    one.until(lambda: heard)
    assert one.node.start.waiting
    monkeypatch.setattr("idloop_nodes.graph_start.NEW", 0.0)  # it has had its time
    one.until(lambda: not one.node.start.waiting)
    assert not one.got["reference"]
    clock.publish(encode_time(10**9))
    one.until(lambda: one.got["reference"])
    namesake.destroy_node()


def test_who_comes_late_to_a_long_run_hears_its_first_words(bench):
    one = bench("recorder", sample_time=0.001)
    one.until(lambda: one.node.start.ready)
    for stamp in range(6000):
        one.node.tell_progress(stamp)
    one.listen("progress")
    one.until(lambda: len(one.got["progress"]) == 2)
    assert {decode_header(data) for data in one.got["progress"]} == {(0, "recorder/ready"), (5999, "recorder")}


def lively(bag, factor):
    """The smallest graph whose simulated time may be slowed."""
    values = {"duration": "4.0", "auto_diagnose": "false", "auto_add": "false", "fit_period": "100.0"}
    return load_graph("hidden", values | {"bag": str(bag), "real_time_factor": factor})


def messages(bag):
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        return [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]


@pytest.mark.slow
@pytest.mark.whole_graph
def test_a_second_graph_in_the_same_domain_ends_and_leaves_the_first_alone(tmp_path):
    assert run_graph(lively(tmp_path / "alone", "0.0"), say=lambda label, line: None)
    lines = []
    first = GraphRun(lively(tmp_path / "first", "0.4"), say=lambda label, line: lines.append(f"{label}: {line}"))
    try:
        deadline = time.monotonic() + 200.0
        first.wait(lambda: any("start: " in line for line in lines) or time.monotonic() > deadline)
        with pytest.raises(InputError, match=r"another node /.* runs in ROS domain"):
            run_graph(lively(tmp_path / "second", "0.0"), say=lambda label, line: None)
        first.wait()
    finally:
        first.stop()
    alone, first = messages(tmp_path / "alone"), messages(tmp_path / "first")
    odd = sorted((topic, stamp) for topic, stamp, _ in set(first) ^ set(alone))
    assert not odd, lines
    assert first == alone


@pytest.mark.slow
@pytest.mark.whole_graph
def test_a_second_graph_beside_one_that_has_run_for_long_in_real_time_ends(tmp_path):
    def graph(name, duration):
        values = {"mode": "realtime", "auto_diagnose": "false", "duration": duration, "bag": str(tmp_path / name)}
        return load_graph("torsion", values)

    lines = []
    first = GraphRun(graph("first", "0.0"), say=lambda label, line: lines.append(line))
    try:
        # Until then two of its nodes have told hundreds of times how far they are.
        deadline = time.monotonic() + 200.0
        first.wait(lambda: any("FIT" in line for line in lines) or time.monotonic() > deadline)
        with pytest.raises(InputError, match=r"another node /.* runs in ROS domain"):
            run_graph(graph("second", "4.0"), say=lambda label, line: None)
        assert len(first.running) == 5
        assert not (tmp_path / "second").exists()
    finally:
        first.stop()
