"""A foreign bag as a table: columns with their places in the bag, units and stamps."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from tests.records.bags.test_control_messages import STATES, states, store_of

import idloop
from idloop.errors import InputError
from idloop.records.recognition.bag_table import bag_table
from idloop.records.recognition.column_name import parse_column_name
from idloop.records.recognition.recognise import recognise_table
from idloop.records.recognition.roles import role_by_name

STORE = get_typestore(Stores.ROS2_HUMBLE)


def robot_bag(folder, torques, angles, speeds, period=0.01, behind=0):
    """A bag as ros2_control records it: commands by their place, joint states by their names."""
    types = STORE.types
    Header, Time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    JointState, Layout = types["sensor_msgs/msg/JointState"], types["std_msgs/msg/MultiArrayLayout"]
    Commands = types["std_msgs/msg/Float64MultiArray"]
    with Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        states = bag.add_connection("/joint_states", JointState.__msgtype__, typestore=STORE)
        commands = bag.add_connection("/effort_controller/commands", Commands.__msgtype__, typestore=STORE)
        for k in range(len(torques)):
            stamp = 1_700_000_000 * 10**9 + round(k * period * 1e9)
            counted = stamp - behind
            header = Header(Time(counted // 10**9, counted % 10**9), "")
            empty = np.zeros(0)
            state = JointState(
                header, ["elbow", "wrist"], np.array([angles[k], 0.3]), np.array([speeds[k], 0.0]), empty
            )
            bag.write(
                commands,
                stamp,
                STORE.serialize_cdr(Commands(Layout([], 0), np.array([torques[k]])), Commands.__msgtype__),
            )
            bag.write(states, stamp + 1000, STORE.serialize_cdr(state, JointState.__msgtype__))
    return folder


@pytest.fixture(scope="module")
def record():
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=10.0, amplitude=0.5, seed=3)
    return idloop.simulate(idloop.load_model("axis"), signal, seed=3)


@pytest.fixture(scope="module")
def bag(record, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags") / "robot_1.5"
    return robot_bag(folder, record.input_at(record.time), record.output[:, 0], record.output[:, 1])


def test_what_is_found_of_the_messages_is_said_of_the_table(bag):
    (note,) = bag_table(bag).table.notes
    assert note.startswith("/effort_controller/commands: the messages carry no stamps (the type has no header)")


def test_columns_have_their_place_their_unit_and_their_stamps(bag):
    found = bag_table(bag)
    assert found.sources["/joint_states elbow position measured"] == {
        "topic": "/joint_states", "source_joint": "elbow", "field": "position"
    }  # fmt: skip
    assert found.table.units["/joint_states elbow velocity measured"] == "rad/s"
    assert found.table.clocks["/joint_states elbow position measured"] == "/joint_states stamps"
    assert np.diff(found.table.numbers("/joint_states stamps")) == pytest.approx(0.01)


def test_the_joint_that_moves_and_its_command_are_recognised(bag):
    read = bag_table(bag)
    found = recognise_table(read.table, sources=read.sources, joints=read.joints)
    columns = {one.role: one.column for one in found.guesses}
    assert columns["position"] == "/joint_states elbow position measured"
    assert columns["velocity"] == "/joint_states elbow velocity measured"
    assert columns["command"].startswith("/effort_controller/commands")
    assert found.of("command").unit == "N·m"


def test_a_robot_bag_is_started_with_in_one_step(bag, tmp_path):
    begun = idloop.start(bag, tmp_path / "begun")
    assert begun.bags[0].name == "robot_1.5"
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_topics_without_a_common_clock_are_joined_by_their_receipt(record, tmp_path):
    bag = robot_bag(
        tmp_path / "simulated", record.input_at(record.time), record.output[:, 0], record.output[:, 1],
        behind=1_699_999_988 * 10**9,
    )  # fmt: skip
    assert bag_table(bag).received
    begun = idloop.start(bag, tmp_path / "begun")
    assert any("use_sim_time" in doubt for doubt in begun.log.recognition.all_doubts())
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_a_bag_without_numbers_is_one_line(tmp_path):
    Text = STORE.types["std_msgs/msg/String"]
    with Writer(tmp_path / "talk", version=8) as writer:
        topic = writer.add_connection("/chatter", Text.__msgtype__, typestore=STORE)
        writer.write(topic, 1, STORE.serialize_cdr(Text("hello"), Text.__msgtype__))
    with pytest.raises(InputError, match="no topic carries numbers"):
        bag_table(tmp_path / "talk")


def test_states_of_the_hardware_are_measured(tmp_path, write_messages):
    store = store_of()
    messages = [(k, states(store, k, [("a", {"position": k / 8, "effort": np.sin(k)})])) for k in range(30)]
    path = write_messages(tmp_path / "bag", [("/dynamic_joint_states", STATES, messages)], "MCAP", store)
    columns = ["/dynamic_joint_states a position measured", "/dynamic_joint_states a effort measured"]
    assert list(bag_table(path).fields) == columns
    assert [role_by_name(parse_column_name(name)).role for name in columns] == ["position", "effort"]
