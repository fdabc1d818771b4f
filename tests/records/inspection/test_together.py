"""Excitation that one record lacks and another one has."""

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
from idloop.records.inspection.together import judged_together


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
