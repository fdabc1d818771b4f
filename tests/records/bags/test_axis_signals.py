"""Command and measurements of a bag without a model."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import make_stream, read_record, write_bag
from idloop.records.bags.axis_signals import axis_signals, chosen_outputs

STAMPS = 10**9 + 10**7 * np.arange(300)
RANDOM = np.random.default_rng(1)
MOVES = RANDOM.normal(size=300)


def bag(tmp_path, command, states, **options):
    streams = [make_stream("/axis/joint_command", STAMPS, command), make_stream("/axis/joint_states", STAMPS, states)]
    return write_bag(tmp_path / "bag", streams, **options)


@pytest.fixture
def two_joints(tmp_path):
    states = {
        "motor": {"position": MOVES, "velocity": 2 * MOVES, "effort": np.zeros(300)},
        "load": {"position": -MOVES},
    }
    units = json.dumps({"units": {"joint_states motor.position": "rad", "joint_command motor.effort": "V"}})
    return bag(tmp_path, {"motor": {"effort": MOVES}}, states, custom={"idloop.import": units})


def test_every_field_of_the_commanded_joint_that_moves(two_joints):
    found = axis_signals(two_joints)
    assert found.input.name == "motor.effort"
    assert found.output_names == ("motor.position", "motor.velocity")
    assert [found.input.unit, *(output.unit for output in found.outputs)] == ["V", "rad", "-"]
    record = read_record(two_joints, found)
    np.testing.assert_array_equal(record.output[:, 1], 2 * MOVES)


def test_outputs_may_be_chosen_from_any_joint(two_joints):
    found = axis_signals(two_joints, ["load.position", "motor.velocity"])
    assert found.output_names == ("load.position", "motor.velocity")
    assert chosen_outputs(found, ["motor.velocity"]).output_names == ("motor.velocity",)
    assert chosen_outputs(found, ()) == found


def test_what_is_not_there_is_said_in_one_line(two_joints, tmp_path):
    with pytest.raises(InputError, match=r"did you mean 'motor\.velocity'"):
        axis_signals(two_joints, ["motor.velocty"])
    with pytest.raises(InputError, match="did you mean 'motor'"):
        axis_signals(two_joints, joint="moter")
    with pytest.raises(InputError, match=r"load\.position"):
        chosen_outputs(axis_signals(two_joints), ["load.position"])
    (tmp_path / "other").mkdir()
    both = bag(
        tmp_path / "other",
        {"a": {"effort": MOVES}, "b": {"effort": MOVES}},
        {"a": {"position": MOVES}, "b": {"position": np.zeros(300)}},
    )
    with pytest.raises(InputError, match="--joint"):
        axis_signals(both)
    assert axis_signals(both, joint="a").output_names == ("a.position",)
    with pytest.raises(InputError, match="no field of joint 'b' that moves"):
        axis_signals(both, joint="b")
