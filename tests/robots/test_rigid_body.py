from __future__ import annotations

import sys

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.robots.rigid_body import RigidBody

MOTION = np.random.default_rng(0).normal(size=(3, 20, 2))


def test_the_torque_of_a_resting_arm_is_its_weight(urdf):
    robot = RigidBody(urdf)
    still = np.zeros((1, 2))
    found = robot.torque(robot.nominal, np.array([[0.5 * np.pi, 0.0]]), still, still)[0]
    elbow = 9.81 * (0.8 * 0.15 + 0.2 * 0.3)
    shoulder = 9.81 * (1.5 * 0.2 + 0.8 * 0.55 + 0.2 * 0.7)
    assert found == pytest.approx([-shoulder, -elbow], rel=1e-9)


def test_the_torque_is_linear_in_the_parameters(urdf):
    robot = RigidBody(urdf)
    parameters = robot.nominal * np.random.default_rng(1).uniform(0.5, 1.5, 20)
    assert robot.regressor(*MOTION) @ parameters == pytest.approx(robot.torque(parameters, *MOTION), abs=1e-10)


def test_the_own_inertia_is_what_an_acceleration_needs(urdf):
    robot = RigidBody(urdf)
    q, still, one = MOTION[0], np.zeros((20, 2)), np.tile([0.0, 1.0], (20, 1))
    needed = robot.torque(robot.nominal, q, still, one) - robot.torque(robot.nominal, q, still, still)
    assert robot.own_inertia(robot.nominal, q)[:, 1] == pytest.approx(needed[:, 1])


def test_joints_come_in_the_order_asked_for_and_others_are_fixed(urdf):
    both, swapped, one = RigidBody(urdf), RigidBody(urdf, ("elbow", "shoulder")), RigidBody(urdf, ("elbow",))
    turned = [motion[:, ::-1] for motion in MOTION]
    expected = both.torque(both.nominal, *MOTION)
    assert swapped.torque(swapped.nominal, *turned)[:, ::-1] == pytest.approx(expected)
    alone = [np.column_stack([np.zeros(20), motion[:, 1]]) for motion in MOTION]
    assert one.torque(one.nominal, *(motion[:, 1:] for motion in MOTION)) == pytest.approx(
        both.torque(both.nominal, *alone)[:, 1:]
    )
    alone = [motion[:, 1:] for motion in MOTION]
    assert one.regressor(*alone) @ one.nominal == pytest.approx(one.torque(one.nominal, *alone))
    assert both.types == ("revolute", "continuous")
    assert both.limits["upper"].tolist() == [2.0, np.inf]


def test_bad_descriptions_are_refused(urdf, tmp_path):
    with pytest.raises(InputError, match=r"no movable joint 'elbw'.*did you mean"):
        RigidBody(urdf, ("elbw",))
    with pytest.raises(InputError, match="cannot be read as a URDF"):
        RigidBody(tmp_path / "none.urdf")
    (tmp_path / "other.urdf").write_text("<mujoco/>")
    with pytest.raises(InputError, match="no <robot> in it"):
        RigidBody(tmp_path / "other.urdf")
    (tmp_path / "broken.urdf").write_text("<robot name='x'><link name='a'/><joint name='j'/></robot>")
    with pytest.raises(InputError, match=r"broken\.urdf"):
        RigidBody(tmp_path / "broken.urdf")


def test_a_missing_extra_is_one_line(urdf, monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(InputError, match=r"pip install 'idloop\[robot\]'"):
        RigidBody(urdf)
