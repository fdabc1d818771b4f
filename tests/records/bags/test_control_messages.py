"""Messages of ros2_control: values are found by joint and field, and by their place in the message."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import read_streams
from idloop.records.bags.message_types import FORMS
from idloop.records.bags.stream import JOINT_STATE
from idloop.records.recognition.bag_table import fields_of

STATES, CONTROLLER = "control_msgs/msg/DynamicJointState", "control_msgs/msg/JointTrajectoryControllerState"
COUNT = 30


@pytest.fixture(params=range(len(FORMS[CONTROLLER])))
def form(request: pytest.FixtureRequest) -> int:
    return request.param


def store_of(form: int = 0) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(dict(get_types_from_msg(FORMS[STATES][0], STATES)))
    store.register(dict(get_types_from_msg(FORMS[CONTROLLER][form], CONTROLLER)))
    return store


def header(store: Any, k: int) -> Any:
    return store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, k + 1), "")


def states(store: Any, k: int, joints: list[tuple[str, dict[str, float]]]) -> Any:
    value = store.types["control_msgs/msg/InterfaceValue"]
    items = [value(list(own), np.array(list(own.values()))) for _, own in joints]
    return store.types[STATES](header(store, k), [name for name, _ in joints], items)


def controller(store: Any, k: int) -> Any:
    """Two joints; a field of the state is 1, 2, ... in its order, plus k."""
    empty = np.zeros(0)
    point, many = (
        store.types[f"trajectory_msgs/msg/{name}"] for name in ("JointTrajectoryPoint", "MultiDOFJointTrajectoryPoint")
    )
    time = store.types["builtin_interfaces/msg/Duration"](0, 0)
    values: list[Any] = []
    for index, (name, _) in enumerate(store.fielddefs[CONTROLLER][1][2:], 1):
        if name.startswith("multi"):
            values.append([] if name.endswith("names") else many([], [], [], time))
        else:
            values.append(point(np.array([0.0, index + k]), empty, empty, empty, time))
    return store.types[CONTROLLER](header(store, k), ["other", "arm.j1"], *values)


def test_values_by_joint_though_the_joints_change_place(tmp_path: Path, write_messages: Any) -> None:
    store, messages = store_of(), []
    for k in range(COUNT):
        both = [("a", {"position": k / 8, "effort": 1.0}), ("arm.j1", {"velocity": 2.0 * k, "temperature": 40.0})]
        messages.append((k, states(store, k, both[:: 1 if k % 2 else -1] if k else both[:1])))
    path = write_messages(tmp_path / "bag", [("/dynamic_joint_states", STATES, messages)], "MCAP", store)
    stream = read_streams(path)["/dynamic_joint_states"]
    assert stream.stamp_ns.tolist() == list(range(1, COUNT + 1))
    np.testing.assert_array_equal(stream.column("a", "position"), np.arange(COUNT) / 8)
    np.testing.assert_array_equal(stream.number("arm.j1", "velocity"), [np.nan, *(2.0 * np.arange(1, COUNT))])
    np.testing.assert_array_equal(stream.number("", "temperature")[1:], 40.0)
    with pytest.raises(
        InputError, match=r"no field 'interface_values\[0\]"
    ):  # it is that of another joint now and then
        stream.number("", "interface_values[0].values[0]")
    with pytest.raises(InputError, match=r"did you mean 'a\.position'"):
        stream.number("a", "positio")


def test_values_by_their_place_where_the_joints_keep_it(tmp_path: Path, write_messages: Any) -> None:
    store = store_of()
    joints = [("a", {"position": 1.0, "effort": 2.0}), ("b", {"position": 3.0})]
    messages = [(k, states(store, k, joints)) for k in range(COUNT)]
    path = write_messages(tmp_path / "bag", [("/dynamic_joint_states", STATES, messages)], "MCAP", store)
    stream = read_streams(path)["/dynamic_joint_states"]
    assert stream.number("", "interface_values[0].values[1]")[0] == 2.0
    assert stream.number("", "interface_values[1].values[0]")[0] == 3.0
    with pytest.raises(InputError, match=r"several joints have position .*source_joint"):
        stream.number("", "position")


@pytest.mark.parametrize("known", [True, False], ids=["defined in the bag", "not defined"])
def test_controller_state_in_every_form(tmp_path: Path, write_messages: Any, form: int, *, known: bool) -> None:
    store = store_of(form)
    messages = [(k, controller(store, k)) for k in range(COUNT)]
    path = write_messages(tmp_path / "bag", [("/jtc/state", CONTROLLER, messages)], "SQLITE3", store)
    if not known:  # as in bags of ROS 2 Humble
        with sqlite3.connect(next(path.glob("*.db3"))) as base:
            base.execute("DELETE FROM message_definitions")
        base.close()
    stream = read_streams(path)["/jtc/state"]
    names = [name for name, _ in store.fielddefs[CONTROLLER][1][2:] if not name.startswith("multi")]
    for index, name in enumerate(names, 1):
        np.testing.assert_array_equal(stream.number("arm.j1", f"{name}.positions"), index + np.arange(COUNT))
        np.testing.assert_array_equal(stream.number("", f"{name}.positions[1]"), index + np.arange(COUNT))
    assert {name.partition(".")[0] for name in stream.names} == {"other", "arm"}


def test_a_bag_says_what_it_offers(tmp_path: Path, write_messages: Any, joint_state: Any) -> None:
    store = store_of()
    number, array = store.types["std_msgs/msg/Float64"], store.types["std_msgs/msg/Float64MultiArray"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    joints = [("a.b", {"position": 1.0, "effort": 2.0})]
    late = 10_000_000
    path = write_messages(
        tmp_path / "bag",
        [
            ("/dyn", STATES, [(k * late, states(store, k, joints)) for k in range(COUNT)]),
            ("/jtc", CONTROLLER, [(k * late, controller(store, k)) for k in range(COUNT)]),
            ("/js", JOINT_STATE, [(k * late // 2, joint_state(k + 1, ["m.x"], [k], effort=[1])) for k in range(1000)]),
            ("/u", "std_msgs/msg/Float64", [(k * late, number(float(k > 20))) for k in range(COUNT)]),
            (
                "/commands",
                "std_msgs/msg/Float64MultiArray",
                [(k, array(layout, np.array([1.0, k]))) for k in range(COUNT)],
            ),
            ("/text", "std_msgs/msg/String", [(0, store.types["std_msgs/msg/String"]("hello"))]),
        ],
        "MCAP",
        store,
    )
    streams = read_streams(path)
    found = [one for stream in streams.values() for one in fields_of(stream, {"m.x.position": "rad"})]
    by_name = {(one.topic, one.joint, one.field): one for one in found}
    assert by_name.keys() >= {
        ("/dyn", "a.b", "position"),
        ("/dyn", "a.b", "effort"),
        ("/js", "m.x", "position"),
        ("/js", "m.x", "effort"),
        ("/u", "", ""),
        ("/commands", "", "data[0]"),
        ("/commands", "", "data[1]"),
        ("/jtc", "other", "reference.positions"),
        ("/jtc", "arm.j1", "output.positions"),
    }
    assert "/text" not in {one.topic for one in found}
    assert by_name["/js", "m.x", "position"].unit == "rad"
    # Every one is found under the name that is given for it.
    for one in found:
        assert np.isfinite(streams[one.topic].number(one.joint, one.field)).any()


def test_the_recording_that_failed(data_dir: Path, tmp_path: Path) -> None:
    from idloop.records.tables.importing import import_bag

    folder = data_dir / "failing_inputs" / "07_bags"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    by_place = tmp_path / "place"
    import_bag(folder / "dyn_mcap", by_place, folder / "dyn.yaml")
    mapping = tmp_path / "joint.yaml"
    mapping.write_text(
        "schema: idloop/mapping/1\nname: dyn\njoint: j\n"
        "command: {topic: dynamic_joint_states, source_joint: j, field: effort, unit: 'N·m'}\n"
        "position: {topic: jtc/controller_state, source_joint: j, field: feedback.positions, unit: rad}\n"
    )
    by_joint = tmp_path / "joint"
    import_bag(folder / "dyn_mcap", by_joint, mapping)
    first, second = read_streams(by_place), read_streams(by_joint)
    np.testing.assert_array_equal(first["/joint_command"].effort, second["/joint_command"].effort)
    np.testing.assert_array_equal(first["/joint_states"].position, second["/joint_states"].position)
    assert np.ptp(first["/joint_states"].position) > 1
