"""The robot's side of the bridge: joints by name, units, the messages of three kinds of robots."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.codec import (
    CdrError,
    JointSample,
    decode_joint_state,
    encode_float,
    encode_floats,
    encode_joint_state,
)
from idloop_nodes.descriptions import describe
from idloop_nodes.parameters import accept_all
from idloop_nodes.safety.robot_joints import RobotJoints
from idloop_nodes.safety.safety_gate import gate_settings

ARM = ("wrist", "elbow", "shoulder")


def values(**more):
    given = {"robot_joints": ["elbow"], "limit.command": 2.0} | {
        name.replace("__", "."): value for name, value in more.items()
    }
    return accept_all(describe("bridge").parameters(), given)


def arm(position=(0.1, 0.2, 0.3), velocity=(1.0, 2.0, 3.0), effort=(10.0, 20.0, 30.0), names=ARM):
    return encode_joint_state(JointSample(7, names, position, velocity, effort))


def number(data):
    """Of a Float64."""
    return struct.unpack_from("<d", data, 4)[0]


def numbers(data):
    """Of a Float64MultiArray without dimensions."""
    return tuple(np.frombuffer(data, offset=20))


@pytest.mark.ros
@given(st.lists(st.floats(allow_nan=False), max_size=5))
def test_ros_reads_our_floats(values):
    serialization = pytest.importorskip("rclpy.serialization")
    from std_msgs.msg import Float64, Float64MultiArray

    assert list(serialization.deserialize_message(encode_floats(values), Float64MultiArray).data) == values
    for value in values:
        assert serialization.deserialize_message(encode_float(value), Float64).data == value


def test_a_joint_is_found_by_name_and_renamed():
    robot = RobotJoints(values(joints=["motor"]))
    stamp, read = robot.read(arm())
    assert (stamp, read) == (7, [0.2, 2.0, 20.0])
    sample = decode_joint_state(robot.pack(9, read))
    assert (sample.stamp_ns, sample.names) == (9, ("motor",))
    assert (sample.position, sample.velocity) == ((0.2,), (2.0,))
    assert math.isnan(sample.effort[0]), "effort is not among the fields"
    assert robot.read(arm((0.5,), (0.0,), (), names=("gripper",))) is None
    assert robot.read(arm((0.4,), (), (), names=("elbow",)))[1][0] == 0.4


def test_several_joints_are_passed_on_the_driven_first():
    robot = RobotJoints(values(robot_joints=["elbow", "shoulder"], joints=["motor", "load"], fields=["position"]))
    sample = decode_joint_state(robot.pack(9, robot.read(arm())[1]))
    assert sample.names == ("motor", "load")
    assert sample.position == (0.2, 0.3)


@given(st.integers(0, 400), st.integers(0, 255), st.integers(0, 400))
def test_a_spoilt_message_is_refused_or_read(where, byte, length):
    robot = RobotJoints(values())
    data = bytearray(arm())
    data[where % len(data)] = byte
    try:
        read = robot.read(bytes(data[: length or len(data)]))
    except CdrError:
        return
    assert read is None or len(read[1]) == 3


def test_units_of_the_robot_become_ours():
    robot = RobotJoints(values(scale__position=0.5, offset__position=-1.0, scale__effort=2.0, offset__effort=0.5))
    _, (position, velocity, effort) = robot.read(arm())
    assert (position, velocity, effort) == pytest.approx((-0.9, 1.0, 40.5))
    assert numbers(robot.command(0, 2.5)) == pytest.approx((1.0,))


def test_a_position_command_is_in_the_unit_of_the_measured_position():
    ticks = 4096 / (2 * math.pi)
    robot = RobotJoints(
        values(
            interface="position",
            command_type="float64",
            scale__position=1 / ticks,
            offset__position=-math.pi,
            fields=["position"],
        )
    )
    robot.read(arm((0.0, 3000.0, 0.0)))
    assert number(robot.command(0, 0.0)) == pytest.approx(2048)


def test_one_joint_of_a_controller_of_three():
    robot = RobotJoints(values(controller_joints=list(ARM)))
    assert numbers(robot.command(0, 1.5)) == (0.0, 1.5, 0.0)


def test_the_other_joints_of_a_position_controller_stay_where_they_were():
    robot = RobotJoints(values(controller_joints=list(ARM), interface="position"))
    assert robot.command(0, 1.5) is None, "nobody knows yet where they are"
    robot.read(arm((0.5,), (), (), names=("elbow",)))
    assert robot.command(0, 1.5) is None
    robot.read(arm())
    robot.read(arm(position=(9.0, 9.0, 9.0)))
    assert numbers(robot.command(0, 1.5)) == (0.1, 1.5, 0.3)


def test_topic_based_hardware_takes_joint_states():
    robot = RobotJoints(values(command_type="joint_state", interface="velocity", controller_joints=["elbow", "wrist"]))
    sample = decode_joint_state(robot.command(11, 1.5))
    assert (sample.stamp_ns, sample.names) == (11, ("elbow", "wrist"))
    assert (sample.position, sample.velocity, sample.effort) == ((), (1.5, 0.0), ())


def test_what_cannot_be_told_is_not_told():
    robot = RobotJoints(values(scale__command=1e-300, limit__command=1e12))
    assert robot.command(0, 1e12) is None


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"limit__command": None}, "limit.command is not set"),
        ({"neutral": "hold_measured"}, "neutral hold_measured does not go with the interface effort"),
        ({"interface": "position", "neutral": "zero"}, "neutral zero does not go"),
        ({"interface": "position"}, "needs limit.position_min and limit.position_max"),
        ({"limit__position_min": 1.0, "limit__position_max": 1.0}, "is not below"),
        ({"fields": ["velocity"], "limit__position_max": 1.0}, "needs position among fields"),
        ({"fields": ["effort"], "limit__velocity": 1.0}, "needs position or velocity"),
        ({"fields": ["velocty"]}, "did you mean 'velocity'"),
        ({"robot_joints": []}, "name each joint once"),
        ({"robot_joints": ["elbow", "elbow"]}, "name each joint once"),
        ({"joints": ["a", "b"]}, "2 names for 1"),
        ({"controller_joints": ["wrist"]}, "elbow is not among them"),
        ({"controller_joints": list(ARM), "command_type": "float64"}, "room for one joint"),
        ({"interface": "position", "fields": ["velocity"]}, "add position"),
        ({"scale__position": 0.0}, "scale.position"),
    ],
)
def test_parameters_that_contradict_are_one_line(given, said):
    with pytest.raises(InputError, match=said) as caught:
        _ = RobotJoints(values(**given)), gate_settings(values(**given))
    assert "\n" not in str(caught.value)
