"""A bag of a running robot, imported without any change to the robot, and fitted."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import Plant, load_model
from idloop.records import read_record, read_streams
from idloop.records.tables.importing import import_bag
from idloop.records.tables.mapping import parse_mapping

PERIOD = 0.01
SAMPLES = 1500
START = 1_700_000_000_000_000_000
SUPPLY = 12.0  # V at full duty
TICKS = 4096 / (2 * np.pi)

MAPPING = {
    "schema": "idloop/mapping/1",
    "name": "robot",
    "joint": "motor",
    "command": {"topic": "/driver/duty", "field": "data", "scale": SUPPLY, "unit": "V"},
    "position": {"topic": "/joint_states", "source_joint": "wheel", "scale": 1 / TICKS, "unit": "rad"},
    "velocity": {
        "topic": "/joint_states",
        "source_joint": "wheel",
        "field": "velocity",
        "scale": 1 / TICKS,
        "unit": "rad/s",
    },
}


@pytest.fixture(scope="module")
def driven():
    """Duty, position and velocity in steps of an encoder, of the preset's motor at 100 Hz."""
    plant = Plant(load_model("dc_motor"), seed=3)
    duty = np.repeat(np.random.default_rng(5).uniform(-0.4, 0.4, SAMPLES // 25), 25)
    measured = []
    for index in range(SAMPLES):
        measured.append(plant.measure() * TICKS)
        plant.step(SUPPLY * duty[index], (index + 1) * PERIOD)
    return duty, np.array(measured)


@pytest.fixture
def robot_bag(tmp_path, driven, write_messages, joint_state, typestore):
    """Several joints whose order changes, a gripper that publishes on its own, and a command without a stamp."""
    duty, measured = driven
    number = typestore.types["std_msgs/msg/Float64"]
    states, commands = [], []
    for index, (value, (position, velocity)) in enumerate(zip(duty, measured, strict=True)):
        stamp = START + round(index * PERIOD * 1e9)
        names, places = (["arm", "wheel"], (0, 1)) if index % 7 else (["wheel", "arm"], (1, 0))
        row = np.array([[0.5, 0.0], [position, velocity]])[list(places)]
        states.append((stamp + 300_000, joint_state(stamp, names, row[:, 0], row[:, 1])))
        if index % 3 == 0:
            states.append((stamp + 400_000, joint_state(stamp, ["gripper"], [0.02])))
        commands.append((stamp + 500_000, number(value)))
    return write_messages(
        tmp_path / "robot",
        [
            ("/joint_states", "sensor_msgs/msg/JointState", states),
            ("/driver/duty", "std_msgs/msg/Float64", commands),
        ],
    )


def test_one_joint_of_many_and_a_command_without_stamps(robot_bag, driven, tmp_path):
    import_bag(robot_bag, tmp_path / "bag", parse_mapping(MAPPING, "robot.yaml"))
    streams = read_streams(tmp_path / "bag")
    states, commands = streams["/joint_states"], streams["/joint_command"]
    assert states.names == commands.names == ("motor",)
    np.testing.assert_allclose(states.position[:, 0], driven[1][:, 0] / TICKS)
    np.testing.assert_allclose(states.velocity[:, 0], driven[1][:, 1] / TICKS)
    np.testing.assert_allclose(commands.effort[:, 0], SUPPLY * driven[0])
    assert states.stamp_ns[0] == START, "the robot's own stamps"
    assert commands.stamp_ns[0] == START + 500_000, "without a stamp, when it was received"


def test_the_imported_record_gives_the_machine_back(robot_bag, tmp_path):
    from idloop.estimation import fit

    model = load_model("dc_motor")
    import_bag(robot_bag, tmp_path / "bag", parse_mapping(MAPPING, "robot.yaml"))
    record = read_record(tmp_path / "bag", model)
    result = fit(model, [record])
    assert result.names
    for name, value, deviation in zip(result.names, result.values, result.stderr, strict=True):
        assert abs(value - model.values[name]) < 5 * deviation < 0.25 * model.values[name], name


def test_a_joint_that_the_robot_does_not_have_is_named(robot_bag, tmp_path):
    wrong = MAPPING | {"position": MAPPING["position"] | {"source_joint": "wheele"}}
    with pytest.raises(InputError, match="did you mean 'wheel'") as caught:
        import_bag(robot_bag, tmp_path / "bag", parse_mapping(wrong, "robot.yaml"))
    assert "\n" not in str(caught.value)
