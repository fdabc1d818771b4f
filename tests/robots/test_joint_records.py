from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.robots.conftest import JOINTS, made

from idloop.errors import InputError
from idloop.records import make_stream, write_bag
from idloop.robots.joint_records import read_joints


@pytest.fixture
def write(tmp_path, urdf, true_links):
    """Write a record as a bag, its joints in the opposite order, with changes of the columns."""

    def bag(name="run", change=lambda columns: columns, **options):
        record = made(urdf, true_links, **options)
        columns = {
            joint: {field: getattr(record, field)[:, place].copy() for field in ("position", "velocity", "effort")}
            for place, joint in reversed(list(enumerate(JOINTS)))
        }
        stamps = (record.time * 1e9).round().astype(np.int64) + 10**15
        return write_bag(tmp_path / name, [make_stream("joint_states", stamps, change(columns))]), record

    return bag


def test_joints_come_in_the_robots_order(write):
    path, record = write()
    (found,) = read_joints([path], JOINTS)
    assert found.joints == JOINTS
    for field in ("position", "velocity", "effort"):
        assert getattr(found, field) == pytest.approx(getattr(record, field), abs=1e-9)


def test_a_joint_that_is_missing_now_and_then_is_interpolated(write):
    def change(columns):
        for values in columns["elbow"].values():
            values[50:400:7] = np.nan
        return columns

    path, record = write(change=change)
    (found,) = read_joints([path], JOINTS)
    assert len(found.time) == len(record.time)
    assert found.position == pytest.approx(record.position, abs=2e-3)


def test_a_record_is_cut_where_a_joint_is_missing_for_long(write):
    def change(columns):
        for values in columns["elbow"].values():
            values[1000:1100] = np.nan
        return columns

    path, _ = write(change=change)
    first, second = read_joints([path], JOINTS)
    assert (len(first.time), len(second.time)) == (1000, 1300)
    assert "missing for more than 5 steps" in first.findings[-1].text or any(
        "missing for more than 5 steps" in one.text for one in first.findings
    )


def test_a_velocity_in_another_unit_is_left_out(write):
    def change(columns):
        columns["elbow"]["velocity"] *= 57.3
        return columns

    path, _ = write(change=change)
    (found,) = read_joints([path], JOINTS)
    assert np.isnan(found.velocity[:, 1]).all()
    assert np.isfinite(found.velocity[:, 0]).all()


def test_joints_that_were_not_recorded_are_said(write):
    path, _ = write()
    (found,) = read_joints([path], (*JOINTS, "gripper"))
    assert found.joints == JOINTS
    assert "fixed at 0: gripper" in found.findings[-1].text


def test_a_bag_of_another_robot_or_without_effort_is_refused(write, tmp_path):
    path, record = write()
    with pytest.raises(InputError, match="none of the robot's joints is in it: it has elbow"):
        read_joints([path], ("wrist",))

    def without(columns):
        del columns["elbow"]["effort"]
        return columns

    bare, _ = write("bare", without)
    with pytest.raises(InputError, match="no effort of elbow"):
        read_joints([bare], JOINTS)
    with pytest.raises(InputError, match="given twice"):
        read_joints([path, path], JOINTS)
    with pytest.raises(InputError, match="no bag"):
        read_joints([tmp_path / "none"], JOINTS)
    assert replace(record, bag=1).bag == 1
