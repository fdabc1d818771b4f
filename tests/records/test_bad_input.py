"""Bad input, each refused with one line that says what, where and how to mend it."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import check_identifiable, read_record

N = 200


def _cut(bag, keep):
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:keep])
    return bag


def _with(index, value):
    values = np.sin(np.arange(N) / 10)
    values[index] = value
    return values


# What is wrong, and the words that must be in the line.
BAGS = {
    "missing bag": (lambda make, tmp: tmp / "nowhere", ("nowhere", "no such bag")),
    "missing bag, name misspelt": (lambda make, tmp: make().with_name("mad0"), ("mad0", "did you mean 'made0'")),
    "directory without a bag": (lambda make, tmp: tmp, ("without a bag", "metadata.yaml")),
    "empty file": (lambda make, tmp: _written(tmp / "a.mcap", b""), ("a.mcap", "empty (0 bytes)")),
    "no bag at all": (lambda make, tmp: _written(tmp / "a.csv", b"1,2"), ("a.csv", "idloop start")),
    "cut bag of ROS 1": (
        lambda make, tmp: _written(tmp / "a.bag", b"#ROSBAG V2.0"),
        ("a.bag", "cannot be read", "idloop recover"),
    ),
    "rubbish in a db3": (lambda make, tmp: _written(tmp / "a.db3", b"rubbish" * 99), ("a.db3", "no db3 file")),
    "truncated mcap": (
        lambda make, tmp: _cut(make(np.arange(50_000) / 1000), 5_000_000),
        ("cut off", "messages", "idloop recover"),
    ),
    "mcap cut to its magic": (lambda make, tmp: _cut(make(), 8), ("cut off", "record again")),
    "text named mcap": (lambda make, tmp: _written(tmp / "a.mcap", b"t,u\n0,1\n" * 20), ("a.mcap", "no mcap file")),
    "NaN command": (lambda make, tmp: make(command=np.full(N, np.nan)), ("joint_command motor.effort", "NaN")),
    "infinite command": (lambda make, tmp: make(command=_with(7, np.inf)), ("motor.effort", "infinite", "0.07")),
    "infinite output": (lambda make, tmp: make(velocity=_with(9, -np.inf)), ("motor.velocity", "infinite", "0.09")),
    "output never measured": (lambda make, tmp: make(velocity=np.full(N, np.nan)), ("motor.velocity", "not measured")),
    "constant command": (lambda make, tmp: make(command=np.full(N, 0.5)), ("motor.effort", "constant (0.5 V)")),
    "time running backwards": (lambda make, tmp: make(np.arange(N)[::-1] / 100), ("runs backwards", "joint_")),
    "time set back once": (
        lambda make, tmp: make(np.r_[0 : N // 2, 0 : N // 2] / 100),
        ("runs backwards", "message 100", "record one run per bag"),
    ),
    "two clocks": (
        lambda make, tmp: make(command_time=1e5 + np.arange(N) / 100, command_receive=np.arange(N) / 100),
        ("two clocks", "do not overlap", "/joint_command", "/joint_states"),
    ),
    "3-sample record": (lambda make, tmp: make(np.arange(3) / 100), ("3 samples", "at least 10")),
}

# A model that does not fit the bag.
MODELS = {
    "unknown topic": ({"topic": "joint_comand"}, ("no topic 'joint_comand'", "did you mean 'joint_command'")),
    "unknown joint": ({"joint": "moter"}, ("no joint 'moter'", "did you mean 'motor'")),
    "unknown field": ({"field": "efort"}, ("no field 'efort'", "did you mean 'effort'")),
}


def _written(path, content):
    path.write_bytes(content)
    return path


def _one_line(caught, words):
    text = str(caught.value)
    assert "\n" not in text
    for word in words:
        assert word in text


@pytest.mark.parametrize("name", BAGS)
def test_bad_bag(name, make_bag, tmp_path, model):
    make, words = BAGS[name]
    path = make(make_bag, tmp_path)
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, words)


@pytest.mark.parametrize(
    ("still", "words"),
    [
        (
            {"position": np.ones(N), "velocity": np.zeros(N)},
            ("nothing moves", "motor.position, motor.velocity", "check the sensors"),
        ),
        (
            {"position": np.ones(N)},
            ("motor.position stays at 1 while motor.velocity runs from -10 to 10", "correct the mapping"),
        ),
    ],
)
def test_a_motion_that_no_fit_can_use(still, words, make_bag, model):
    record = read_record(make_bag(**still), model)
    assert "no_motion" in {finding.kind for finding in record.findings}
    with pytest.raises(InputError) as caught:
        check_identifiable(record)
    _one_line(caught, words)
    assert check_identifiable(good := read_record(make_bag(), model)) is good


@pytest.mark.parametrize("name", MODELS)
def test_model_that_does_not_fit(name, bag, model):
    change, words = MODELS[name]
    model.input = SimpleNamespace(
        **({"topic": "joint_command", "joint": "motor", "field": "effort", "unit": "V", "kind": "held"} | change)
    )
    with pytest.raises(InputError) as caught:
        read_record(bag, model)
    _one_line(caught, words)


def test_wrong_type(tmp_path, write_messages, typestore, model):
    text = typestore.types["std_msgs/msg/String"]
    path = write_messages(
        tmp_path / "b",
        [(f"/{name}", "std_msgs/msg/String", [(1, text("x"))]) for name in ("joint_command", "joint_states")],
    )
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, ("wrong type std_msgs/msg/String", "sensor_msgs/msg/JointState"))


def test_empty_bag(tmp_path, write_messages, model):
    path = write_messages(tmp_path / "b", [("/joint_states", "sensor_msgs/msg/JointState", [])])
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, ("the bag is empty", "record again"))


def test_topic_without_messages(tmp_path, write_messages, joint_state, model):
    kind = "sensor_msgs/msg/JointState"
    path = write_messages(
        tmp_path / "b", [("/joint_command", kind, []), ("/joint_states", kind, [(1, joint_state(1, ["motor"], [0.0]))])]
    )
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, ("/joint_command holds no message",))


def test_message_that_is_cut(tmp_path, model, bag, write_messages, joint_state, typestore):
    from rosbags.rosbag2 import StoragePlugin, Writer

    kind = "sensor_msgs/msg/JointState"
    payload = bytes(typestore.serialize_cdr(joint_state(1, ["motor"], [0.0]), kind))[:-9]
    with Writer(tmp_path / "b", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic in ("/joint_command", "/joint_states"):
            writer.write(writer.add_connection(topic, kind, typestore=typestore), 1, payload)
    with pytest.raises(InputError) as caught:
        read_record(tmp_path / "b", model)
    _one_line(caught, ("does not decode", "/joint_"))


def test_damage_inside_a_file(make_bag, model):
    path = make_bag(np.arange(30_000) / 1000)
    file = next(path.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[1000:2000] = b"\xff" * 1000
    file.write_bytes(bytes(content))
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, ("damaged", "copy it again"))


def test_a_bag_file_that_is_missing(make_bag, model):
    path = make_bag()
    shutil.move(next(path.glob("*.mcap")), path.parent / "elsewhere")
    with pytest.raises(InputError) as caught:
        read_record(path, model)
    _one_line(caught, ("cannot be read", "missing"))
