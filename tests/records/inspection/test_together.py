"""What records of one axis show beside each other, and whether they are of one machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idloop.records.inspection.faults.checks import inspect_axis
from idloop.records.inspection.grade import grade
from idloop.records.inspection.inspection import Inspection
from idloop.records.inspection.response import response
from idloop.records.inspection.together import between_records, judged_together


def _inspection(name, *axes):
    findings = tuple(one for axis in axes for one in inspect_axis(axis))
    graded, reason = grade("usable", findings)
    return Inspection(
        Path(name), (), {}, {}, {}, findings, (), "usable", "", grade=graded, grade_reason=reason, axes=axes
    )


@pytest.fixture
def square(make_axis):
    """Records of one axis under two levels each, by the size of these."""
    sign = np.where(np.random.default_rng(3).normal(size=75) > 0, 1.0, -1.0).repeat(40)
    return lambda size: make_axis(command=size * sign)


def _kinds(inspections):
    return [{fault.kind for fault in one.faults} for one in inspections]


def test_levels_add_up_over_records(square):
    once, twice, half = (_inspection(str(size), square(size)) for size in (1.0, 1.0, 0.5))
    assert all("two_levels" in kinds for kinds in _kinds(judged_together([once, twice])))
    judged = judged_together([once, half])
    assert not any("two_levels" in kinds for kinds in _kinds(judged))
    assert [one.grade for one in judged] == ["usable", "usable"]
    assert all("two_levels" in {one.kind for one in each.findings} for each in judged)


def test_of_another_joint_no_record_shows_anything(square):
    once, half = square(1.0), replace(square(0.5), joint="k", command_name="k.effort")
    judged = judged_together([_inspection("one", once), _inspection("two", half)])
    assert all("two_levels" in kinds for kinds in _kinds(judged))


def test_a_range_beside_a_coarse_sensor_is_that_of_all_records(make_axis):
    axis = make_axis()
    step = np.ptp(axis.velocity) / 120.0
    quiet = replace(
        axis, position=None, velocity=step * np.round(0.3 * axis.velocity / step), command=0.3 * axis.command
    )
    loud = replace(axis, position=None, velocity=step * np.round(axis.velocity / step))
    alone, other = _inspection("quiet", quiet), _inspection("loud", loud)
    assert "coarse" in _kinds([alone])[0]
    assert not any("coarse" in kinds for kinds in _kinds(judged_together([alone, other])))


def test_an_inertia_that_a_slow_record_hides_is_known_from_another(make_axis):
    axis = make_axis()
    slow = replace(axis, command=(axis.velocity + 0.8 * np.tanh(axis.velocity / 0.05)) / 10.0)
    alone = _inspection("slow", slow)
    assert "weak_excitation" in _kinds([alone])[0]
    assert "weak_excitation" in _kinds(judged_together([alone, alone]))[0]
    assert "weak_excitation" not in _kinds(judged_together([alone, _inspection("fast", axis)]))[0]


@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(order=st.permutations([1.0, 0.5, 2.0]))
def test_the_order_of_records_changes_nothing(square, order):
    found = dict(zip(order, judged_together([_inspection(str(size), square(size)) for size in order]), strict=True))
    assert {size: one.grade for size, one in found.items()} == dict.fromkeys([0.5, 1.0, 2.0], "usable")


def kinds(**records):
    return [one.kind for one in between_records({name: [axis] for name, axis in records.items()})]


def test_two_records_of_one_machine(make_axis):
    assert kinds(a=make_axis(0), b=make_axis(1), c=make_axis(2, gain=52.0)) == []


def test_another_gain(make_axis):
    (found,) = between_records({"a": [make_axis(0)], "b": [make_axis(1, gain=100.0)]})
    assert found.kind == "other_gain"
    assert 0.4 < found.evidence["ratio"] < 2.4
    assert found.evidence["difference"] > 5.0 * found.evidence["error"]


def test_a_set_point_has_no_gain_to_compare(make_axis):
    """A limit inside the drive's loop makes the same step accelerate less, and is no other machine."""
    one, two = make_axis(0), make_axis(1, gain=100.0)
    assert kinds(a=one, b=two) == ["other_gain"]
    degrees = {"units": {**one.units, "j.effort": "deg"}}
    assert kinds(a=replace(one, **degrees), b=replace(two, **degrees)) == []


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


def test_the_weight_of_an_arm_is_no_other_load(make_axis):
    """The same arm under a slow and under a fast command: the force over the angle is no constant spring."""

    def arm(seed, level):
        rng, rate = np.random.default_rng(seed), 200.0
        time = np.arange(4000) / rate
        frequencies = np.array([0.11, 0.23, 0.47, 0.83, 1.3, 2.1])
        phases = rng.uniform(0.0, 2.0 * np.pi, 6)
        command = np.sin(2.0 * np.pi * frequencies * time[:, None] + phases) @ frequencies**-0.5
        command *= level / np.abs(command).max()
        position, velocity, p, v = np.empty(4000), np.empty(4000), 0.0, 0.0
        for k in range(4000):
            position[k], velocity[k] = p, v
            for _ in range(10):
                v += 0.1 / rate * (2.0 * command[k] - 0.8 * v - 6.0 * np.sin(p))
                p += 0.1 / rate * v
        position += rng.normal(0.0, 5e-4, 4000)
        velocity += rng.normal(0.0, 5e-3, 4000)
        return make_axis(position=position, velocity=velocity, command=command, time=time, input_time=time)

    alone = response(arm(1, 4.0), 0.5), response(arm(7, 3.2), 0.5)
    assert alone[0].gain_of().differs(alone[1].gain_of())
    assert kinds(a=arm(1, 4.0), b=arm(7, 3.2)) == []


LOUD = np.repeat(np.random.default_rng(5).normal(size=150), 20)
QUIET = np.repeat(0.4 * np.random.default_rng(6).normal(size=150), 20)


@pytest.mark.parametrize(
    "drive",
    [
        lambda value: float(np.clip(value, -0.5, 0.5)),
        lambda value: value - float(np.clip(value, -0.3, 0.3)),
    ],
    ids=["limit", "dead zone"],
)
def test_commands_of_other_sizes_are_no_other_machine_behind_a_bent_force(make_axis, drive):
    one, two = make_axis(command=LOUD, drive=drive), make_axis(seed=1, command=QUIET, drive=drive)
    assert not between_records({"loud": [one], "quiet": [two]})


def test_another_load_shows_behind_a_bent_force(make_axis):
    def drive(value: float) -> float:
        return float(np.clip(value, -0.5, 0.5))

    one = make_axis(command=LOUD, drive=drive)
    two = make_axis(seed=1, command=LOUD[::-1].copy(), drive=drive, gain=25.0)
    assert {fault.kind for fault in between_records({"one": [one], "two": [two]})} == {"other_gain"}
