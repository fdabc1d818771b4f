"""Of a requested command and the one that the drive applied, the motion follows the second."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.physics import load_model
from idloop.records import read_record
from idloop.records.bags.stream import JOINT_STATE
from idloop.records.bags.topics import Topic, applied_command_topic
from idloop.records.bags.write import make_stream, write_bag
from idloop.records.inspection.inspection import inspect_bag

STAMPS = 10**9 + np.arange(0, 400) * 10_000_000
REQUESTED = np.sign(np.sin(0.3 * np.arange(400)))
APPLIED = np.where(np.arange(400) < 200, 0.5 * REQUESTED, 0.0)


def bag_with(tmp_path, *topics):
    values = {
        "joint_command": REQUESTED,
        "bridge/command": APPLIED,
        "axis/joint_command": REQUESTED,
        "axis/bridge/command": APPLIED,
    }
    streams = [make_stream(one, STAMPS, {"motor": {"effort": values[one]}}) for one in topics]
    turn = np.cumsum(APPLIED) * 0.01
    space = "axis/" if any(one.startswith("axis/") for one in topics) else ""
    motion = {"position": turn, "velocity": APPLIED}
    return write_bag(tmp_path / "bag", [*streams, make_stream(f"{space}joint_states", STAMPS, {"motor": motion})])


@pytest.mark.parametrize("space", ["", "axis/"])
def test_the_applied_command_is_read(tmp_path, space):
    bag = bag_with(tmp_path, f"{space}joint_command", f"{space}bridge/command")
    record = read_record(bag, load_model("dc_motor"))
    assert np.array_equal(record.input, APPLIED)
    (said,) = (one for one in record.findings if one.kind == "told")
    assert said.level == "note"
    requested = f"not /{space}joint_command, which the controller requested"
    assert said.text == f"the command is /{space}bridge/command, which the drive applied, {requested}"
    seen = inspect_bag(bag)
    assert seen.command_topic == f"/{space}bridge/command"
    assert said in seen.findings
    assert list(seen.signals) == [f"/{space}joint_states"]


def test_without_a_bridge_the_requested_command_is_read(tmp_path):
    record = read_record(bag_with(tmp_path, "joint_command"), load_model("dc_motor"))
    assert np.array_equal(record.input, REQUESTED)
    assert "told" not in {one.kind for one in record.findings}


def test_that_of_another_axis_is_not_taken(tmp_path):
    bag = bag_with(tmp_path, "joint_command", "axis/bridge/command")
    text = load_model("dc_motor").to_yaml().replace("topic: joint_states", "topic: axis/joint_states")
    (tmp_path / "m.yaml").write_text(text)
    assert np.array_equal(read_record(bag, load_model(tmp_path / "m.yaml")).input, REQUESTED)


def test_a_topic_of_that_name_and_another_type_is_none_of_ours():
    topics = {
        name: Topic(name, kind, 5)
        for name, kind in (("/joint_command", JOINT_STATE), ("/bridge/command", "std_msgs/msg/Float64"))
    }
    assert applied_command_topic("/joint_command", topics) == "/joint_command"


def test_a_topic_that_the_user_names_is_taken(tmp_path):
    bag = bag_with(tmp_path, "joint_command", "bridge/command")
    seen = inspect_bag(bag, command="joint_command")
    assert seen.command_topic == "/joint_command"


def test_pauses_of_a_bridge_are_no_losses(tmp_path):
    kept = np.r_[0:100, 150:400]
    streams = [
        make_stream("joint_command", STAMPS, {"motor": {"effort": REQUESTED}}),
        make_stream("bridge/command", STAMPS[kept], {"motor": {"effort": APPLIED[kept]}}),
        make_stream("joint_states", STAMPS, {"motor": {"position": np.cumsum(APPLIED), "velocity": APPLIED}}),
    ]
    record = read_record(write_bag(tmp_path / "bag", streams), load_model("dc_motor"))
    assert not {one.kind for one in record.findings} & {"lost_samples", "gap"}
