from __future__ import annotations

import csv

import numpy as np
import pytest
from ruamel.yaml import YAML

from idloop import excite_robot
from idloop.errors import InputError
from idloop.robots.collision import SelfCollision
from idloop.robots.rigid_body import RigidBody

# A second link that folds back onto a post beside the base.
FOLDING = """<robot name="folding">
  <link name="base"><collision><origin xyz="0.3 0 0.2"/>
    <geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
  <joint name="one" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="30"/></joint>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <joint name="two" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="2" effort="20"/></joint>
  <link name="lower"><inertial><origin xyz="0 0 0.15"/><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><cylinder length="0.3" radius="0.03"/></geometry></collision></link>
</robot>
"""
SMALL = {"period": 6.0, "periods": 1, "harmonics": 3, "starts": 3, "steps": 3}


@pytest.fixture(scope="module")
def folding(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "folding.urdf"
    path.write_text(FOLDING)
    return path


@pytest.fixture(scope="module")
def found(folding):
    return excite_robot(folding, share=0.9, max_acceleration=6.0, **SMALL)


def test_it_stays_within_every_limit_and_begins_and_ends_at_rest(found, folding):
    trajectory, robot = found.trajectory, RigidBody(folding)
    assert np.all(np.abs(trajectory.position) <= 2.7 + 1e-9)
    assert np.all(np.abs(trajectory.velocity) <= 1.8 + 1e-9)
    assert np.all(np.abs(trajectory.acceleration) <= 6.0 + 1e-9)
    motion = (trajectory.position, trajectory.velocity, trajectory.acceleration)
    assert np.all(np.abs(robot.torque(robot.nominal, *motion)) <= 0.9 * np.array([30.0, 20.0]) + 1e-9)
    for values in (trajectory.velocity, trajectory.acceleration):
        assert values[[0, -1]] == pytest.approx(0.0, abs=1e-9)
    slope = np.gradient(trajectory.position, trajectory.time, axis=0)
    assert slope[1:-1] == pytest.approx(trajectory.velocity[1:-1], abs=0.01)


def test_the_links_stay_apart(found, folding):
    collision = SelfCollision(RigidBody(folding))
    assert not collision.problem
    # The folded arm does meet the post.
    assert collision.least_distance(np.array([[0.75, 2.2]]))[0] < 0.0
    assert np.min(collision.least_distance(found.trajectory.position)) >= 0.03 - 1e-3
    assert found.trajectory.distance >= 0.03


def test_it_is_better_than_the_best_random_one(found):
    assert found.trajectory.condition < found.trajectory.before


def test_equal_seeds_give_equal_trajectories(found, folding):
    again = excite_robot(folding, share=0.9, max_acceleration=6.0, **SMALL)
    assert np.array_equal(again.trajectory.position, found.trajectory.position)


def test_the_files_hold_the_points(found, tmp_path):
    with found.save(tmp_path / "t.yaml").open() as file:
        message = YAML(typ="safe").load(file)
    assert message["joint_names"] == ["one", "two"]
    last = message["points"][-1]
    assert last["time_from_start"] == {"sec": 6, "nanosec": 0}
    assert last["positions"] == pytest.approx(found.trajectory.position[-1].tolist(), abs=1e-8)
    with found.save(tmp_path / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found.trajectory.time)
    assert float(rows[10]["two.velocity"]) == pytest.approx(found.trajectory.velocity[10, 1], abs=1e-8)
    with pytest.raises(InputError, match="the suffix must be"):
        found.save(tmp_path / "t.txt")


def test_a_description_without_collision_geometry_is_said(urdf):
    planned = excite_robot(urdf, **{**SMALL, "steps": 0})
    assert "self-collision is not checked" in planned.summary()
    assert planned.plot().axes


def test_a_share_that_is_none_is_refused(urdf):
    with pytest.raises(InputError, match="share"):
        excite_robot(urdf, share=1.5)
