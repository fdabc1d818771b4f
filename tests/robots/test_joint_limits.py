"""Limits of a URDF: read, and which joint exceeds which."""

from __future__ import annotations

import math

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.robots.joint_limits import JointLimits, urdf_limits

JOINTS = ("shoulder", "elbow")


def test_they_come_in_the_order_of_the_joints(urdf):
    found = urdf_limits(urdf, ("elbow", "shoulder"), 7.0)
    assert found.joints == ("elbow", "shoulder")
    assert found.lower.tolist() == [-math.inf, -2.0], "the elbow turns without end"
    assert found.upper.tolist() == [math.inf, 2.0]
    assert found.velocity.tolist() == [3.0, 3.0]
    assert found.effort.tolist() == [10.0, 20.0]
    assert found.acceleration.tolist() == [7.0, 7.0]


def test_an_effort_of_zero_is_no_limit(tmp_path, urdf):
    file = tmp_path / "r.urdf"
    file.write_text(urdf.read_text(encoding="utf-8").replace('effort="20"', 'effort="0"'), encoding="utf-8")
    assert urdf_limits(file, ("shoulder",), 7.0).effort.tolist() == [math.inf]


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('<limit lower="-2" upper="2" velocity="3" effort="20"/>', "", "shoulder: no velocity limit"),
        ('velocity="3" effort="20"', 'effort="20"', "shoulder: no velocity limit"),
        ('upper="2"', 'upper="-2"', "lower limit -2 is not below upper limit -2"),
        ('upper="2"', 'upper="two"', "upper 'two' is no number"),
        ('upper="2"', 'upper="nan"', "upper nan is not finite"),
        ('name="shoulder"', 'name="shoulder1"', "no joint 'shoulder'.*shoulder1"),
        ("</robot>", "", "is no URDF"),
    ],
)
def test_what_is_missing_is_one_line(tmp_path, urdf, before, after, said):
    text = urdf.read_text(encoding="utf-8")
    assert before in text
    file = tmp_path / "r.urdf"
    file.write_text(text.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        urdf_limits(file, JOINTS, 7.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (((1.0, 0.0), (2.0, -2.0), (3.0, 3.0)), ""),
        (((1.0, 0.0), (math.nan, math.nan), (math.nan, math.nan)), ""),
        (((0.0, 1.001), (0.0, 0.0), (0.0, 0.0)), "position 1.001 of elbow is outside -1 .. 1"),
        (((-1.001, 0.0), (0.0, 0.0), (0.0, 0.0)), "position -1.001 of shoulder is outside -1 .. 1"),
        (((0.0, 0.0), (0.0, -2.001), (0.0, 0.0)), "velocity -2.001 of elbow is beyond 2"),
        (((0.0, 0.0), (0.0, 0.0), (3.001, 0.0)), "effort 3.001 of shoulder is beyond 3"),
    ],
)
def test_a_measurement_on_both_sides_of_every_limit(state, said):
    ends = (np.array([one, one]) for one in (-1.0, 1.0, 2.0, 3.0, 9.0))
    assert JointLimits(JOINTS, *ends).breach(*state) == said
