"""Topics of every type and storage become arrays; what cannot be read does not stop the rest."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import read_streams
from idloop.records.bags.bag import Bag
from idloop.records.bags.stream import JOINT_STATE


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("distro", ["humble", "jazzy", "kilted", "lyrical"])
def test_storage_and_distribution(tmp_path, write_messages, joint_state, storage, distro):
    from rosbags.typesys import Stores, get_typestore

    messages = [(k + 5, joint_state(k + 1, ["motor"], [k], [2 * k])) for k in range(20)]
    path = write_messages(
        tmp_path / "bag", [("/joint_states", JOINT_STATE, messages)], storage, get_typestore(Stores(f"ros2_{distro}"))
    )
    with Bag(path, distro) as bag:
        stream = read_streams(bag)["/joint_states"]
    assert stream.stamp_ns.tolist() == list(range(1, 21))
    assert stream.receive_ns.tolist() == list(range(5, 25))
    np.testing.assert_array_equal(stream.column("motor", "velocity"), 2.0 * np.arange(20))
    assert np.isnan(stream.effort).all()
    single = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    assert len(read_streams(single)["/joint_states"]) == 20


def test_a_bag_without_its_metadata_is_read_from_its_files(bag):
    (bag / "metadata.yaml").unlink()
    assert len(read_streams(bag)["/joint_states"]) == 2000


def test_joints_that_change_place(tmp_path, write_messages, joint_state):
    messages = [
        (1, joint_state(1, ["a", "b"], [1, 2])),
        (2, joint_state(2, ["b", "a"], [20, 10])),
        (3, joint_state(3, ["b"], [200])),
    ]
    stream = read_streams(write_messages(tmp_path / "bag", [("/joint_states", JOINT_STATE, messages)]))["/joint_states"]
    assert stream.names == ("a", "b")
    np.testing.assert_array_equal(stream.position, [[1, 2], [10, 20], [np.nan, 200]])


def test_bare_numbers_use_receive_stamps_and_say_so(tmp_path, write_messages, typestore):
    types = typestore.types
    layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
    path = write_messages(
        tmp_path / "bag",
        [
            (
                "/effort_controller/commands",
                "std_msgs/msg/Float64MultiArray",
                [
                    (k, types["std_msgs/msg/Float64MultiArray"](layout, np.array([k, -k], dtype=float)))
                    for k in range(5, 9)
                ],
            ),
            ("/u", "std_msgs/msg/Float64", [(k, types["std_msgs/msg/Float64"](float(k))) for k in range(5, 9)]),
        ],
    )
    streams = read_streams(path)
    array, number = streams["/effort_controller/commands"], streams["/u"]
    assert array.stamp_ns.tolist() == [5, 6, 7, 8]
    assert not array.stamped
    assert [finding.kind for finding in array.findings] == ["receive_stamps"]
    np.testing.assert_array_equal(array.column("1", "effort"), [-5, -6, -7, -8])
    np.testing.assert_array_equal(number.column("motor", "effort"), [5, 6, 7, 8])
    with pytest.raises(InputError, match="no value 'motor'"):
        array.column("motor", "effort")


def test_a_stamped_type_by_the_path_of_its_number(tmp_path, write_messages, typestore):
    types = typestore.types
    vector = types["geometry_msgs/msg/Vector3"]

    def wrench(k):
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](k, 0), "")
        both = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, 1.5 * k), vector(0.0, 0.0, 0.0))
        return types["geometry_msgs/msg/WrenchStamped"](header, both)

    path = write_messages(
        tmp_path / "bag", [("/ft", "geometry_msgs/msg/WrenchStamped", [(k, wrench(k)) for k in range(1, 5)])]
    )
    stream = read_streams(path, ["ft"])["/ft"]
    assert stream.stamped
    assert stream.stamp_ns.tolist() == [k * 10**9 for k in range(1, 5)]
    np.testing.assert_array_equal(stream.column("wrench.force.z", "effort"), 1.5 * np.arange(1, 5))


def test_an_unknown_type_does_not_stop_the_others(tmp_path, write_messages, joint_state, typestore):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    own = get_typestore(Stores.ROS2_JAZZY)
    own.register(get_types_from_msg("float32 pos\nuint8 state", "my_msgs/msg/Odd"))
    odd = own.types["my_msgs/msg/Odd"]
    path = write_messages(
        tmp_path / "bag",
        [
            ("/odd", "my_msgs/msg/Odd", [(k, odd(k / 2, 1)) for k in range(4)]),
            ("/joint_states", JOINT_STATE, [(k, joint_state(k + 1, ["motor"], [k])) for k in range(4)]),
        ],
        "SQLITE3",
        own,
    )
    import sqlite3

    # One that refers to another unknown type; then none, as in bags of ROS 2 Humble and older.
    refers = "SET encoded_message_definition = 'gone_msgs/Gone gone' WHERE topic_type = 'my_msgs/msg/Odd'"
    for change in (f"UPDATE message_definitions {refers}", "DELETE FROM message_definitions"):
        with sqlite3.connect(next(path.glob("*.db3"))) as base:
            assert base.execute(change).rowcount > 0
        base.close()
        assert set(read_streams(path)) == {"/joint_states"}
        with pytest.raises(InputError, match="unknown type my_msgs/msg/Odd"):
            read_streams(path, ["odd"])
    with Bag(path, definitions={"my_msgs/msg/Odd": "float32 pos\nuint8 state"}) as bag:
        told = read_streams(bag)
    np.testing.assert_array_equal(told["/odd"].column("pos", "position"), [0, 0.5, 1, 1.5])


def test_the_real_foreign_bag(data_dir):
    path = data_dir / "odrive_rosbag2_idle" / "rosbag2_2024_08_22-12_20_42"
    assert read_streams(path) == {}
