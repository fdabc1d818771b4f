"""Records that do not belong together are named; those of one machine are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.inspection.between import between_records


def kinds(**records):
    return [one.kind for one in between_records({name: [axis] for name, axis in records.items()})]


def test_two_records_of_one_machine(make_axis):
    assert kinds(a=make_axis(0), b=make_axis(1), c=make_axis(2, gain=52.0)) == []


def test_another_gain(make_axis):
    (found,) = between_records({"a": [make_axis(0)], "b": [make_axis(1, gain=100.0)]})
    assert found.kind == "other_gain"
    assert 0.4 < found.evidence["ratio"] < 2.4
    assert found.evidence["difference"] > 5.0 * found.evidence["error"]


def test_other_units_joints_and_rates(make_axis):
    one = make_axis()
    degrees = replace(one, units={**one.units, "j.position": "deg"})
    assert kinds(a=one, b=degrees) == ["other_units"]
    assert kinds(a=one, b=replace(one, joint="k")) == ["other_joints"]
    half = replace(one, time=one.time[::2], position=one.position[::2], velocity=one.velocity[::2])
    assert kinds(a=one, b=half) == ["other_rate"]


def test_friction_does_not_look_like_another_gain(make_axis):
    slow = make_axis(1, command=0.3 * np.repeat(np.random.default_rng(5).normal(size=75), 40))
    assert kinds(a=make_axis(0), b=slow) == []
