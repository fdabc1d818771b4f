"""The look at a bag says what the data can show, and is honest when it can show nothing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import inspect_bag


def _said(inspection, *words):
    text = "\n".join(inspection.insights)
    return all(word in text for word in words)


def test_good_record(bag):
    found = inspect_bag(bag)
    assert found.verdict == "usable"
    assert found.command_topic == "/joint_command"
    assert set(found.signals["/joint_states"]) == {"motor.position", "motor.velocity"}
    assert _said(found, "90 % of the command's power", "The loop is closed")
    assert not _said(found, "two levels")
    topic = next(topic for topic in found.topics if topic.name == "/joint_states")
    assert topic.stamps.rate == pytest.approx(1000.0)
    assert topic.delay == {"p50": 0.0, "p99": 0.0, "max": 0.0}


def test_two_level_command_hides_the_dead_zone(make_bag):
    found = inspect_bag(make_bag(command=np.where(np.arange(200) // 7 % 2, 1.0, -1.0)))
    (fault,) = (one for one in found.faults if one.kind == "two_levels")
    assert fault.spoils == ("dead zone", "limits of the drive")
    assert found.verdict == "usable"
    assert found.grade.startswith("not usable for dead zone")


def test_motion_one_way(make_bag):
    position = np.arange(200) ** 1.1
    found = inspect_bag(
        make_bag(position=position, velocity=np.gradient(position), command=1.5 + np.sin(np.arange(200) / 5))
    )
    assert _said(found, "one way only", "never changes its sign")


def test_coasting_is_seen(make_bag):
    command = np.where(np.arange(200) < 100, np.sin(np.arange(200)), 0.0)
    found = inspect_bag(make_bag(command=command, velocity=np.exp(-np.arange(200) / 100)))
    assert _said(found, "coasts with zero command")


@pytest.mark.parametrize("what", ["constant command", "no motion"])
def test_nothing_can_be_identified(make_bag, what):
    rng = np.random.default_rng(0)
    quiet = {"position": 1e-4 * rng.normal(size=200), "velocity": np.zeros(200)}
    found = inspect_bag(make_bag(**({"command": np.ones(200)} if what == "constant command" else quiet)))
    assert found.verdict == "not_excited"
    assert _said(found, "nothing can be identified")


def test_a_position_that_stands_still_beside_its_velocity(make_bag):
    found = inspect_bag(make_bag(position=np.full(200, 0.7)))
    assert found.verdict == "contradictory"
    assert _said(found, "motor.position stays at 0.7 while motor.velocity runs from -10 to 10", "correct the mapping")


@pytest.mark.parametrize(("count", "verdict"), [(9, "too_short"), (29, "short"), (100, "usable")])
def test_few_samples(make_bag, count, verdict):
    found = inspect_bag(make_bag(np.arange(count) / 100))
    assert found.verdict == verdict
    assert _said(found, f"{count} samples in {(count - 1) / 100:g} s") == (verdict != "usable")


def test_holes_are_told_with_their_places(make_bag):
    time = np.arange(200)
    command = np.where((time > 49) & (time < 60), np.nan, np.sin(time))
    found = inspect_bag(make_bag(command=command, velocity=np.where(time == 7, np.nan, np.cos(time / 10))))
    said = {finding.where: finding for finding in found.findings if finding.kind == "not_measured"}
    assert said["/joint_command"].level == "warning"
    assert "10 of 200 values are missing (NaN), from 0.5 to 0.59 s; the command before" in said["/joint_command"].text
    assert "1 of 200 values are missing (NaN), at 0.07 s" in said["/joint_states"].text


def test_bad_clocks_are_findings_here_not_errors(make_bag):
    backwards = inspect_bag(make_bag(np.r_[0:100, 0:100] / 100))
    assert "clock_reset" in {finding.kind for finding in backwards.findings}
    assert backwards.verdict == "several_runs"
    assert _said(backwards, "2 runs in one bag")
    apart = inspect_bag(make_bag(command_time=1e6 + np.arange(200) / 100, command_receive=np.arange(200) / 100))
    assert "two_clocks" in {finding.kind for finding in apart.findings}
    infinite = inspect_bag(make_bag(velocity=np.where(np.arange(200) == 3, np.inf, 0.0)))
    assert "infinite" in {finding.kind for finding in infinite.findings}


def test_without_a_command(tmp_path, write_messages, joint_state):
    messages = [(k + 1, joint_state(k + 1, ["motor"], [np.sin(k / 20)])) for k in range(300)]
    path = write_messages(tmp_path / "b", [("/joint_states", "sensor_msgs/msg/JointState", messages)])
    found = inspect_bag(path)
    assert found.verdict == "no_command"
    assert inspect_bag(path, command="joint_states").command_topic == "/joint_states"
    with pytest.raises(InputError, match="no topic 'u'"):
        inspect_bag(path, command="u")


def test_unreadable_types_give_rates_and_no_more(tmp_path, write_messages, typestore):
    text = typestore.types["std_msgs/msg/String"]
    path = write_messages(
        tmp_path / "b", [("/log", "std_msgs/msg/String", [(k * 10**7, text("x")) for k in range(1, 99)])]
    )
    found = inspect_bag(path)
    assert found.verdict == "unreadable"
    assert found.topics[0].receive.rate == pytest.approx(100.0)
    assert not found.topics[0].readable


def test_the_real_idle_axis(data_dir):
    found = inspect_bag(data_dir / "odrive_rosbag2_idle" / "rosbag2_2024_08_22-12_20_42")
    assert found.verdict == "not_excited"
    assert _said(found, "Nothing moves")
    assert {"receive_stamps", "jitter"} <= {finding.kind for finding in found.findings}
    assert found.topics[0].count == 1549


def test_json(bag):
    document = inspect_bag(bag).to_dict()
    assert document["schema"] == "idloop/inspect/1"
    assert json.loads(json.dumps(document, default=str))["verdict"] == "usable"
