"""A ladder is judged as a reader would judge it."""

from __future__ import annotations

import pytest
from case import Case, Drive, Hidden
from intervals import clopper_pearson
from machines import base_model
from score import Rung, score


def case_with(*names, machine="dc_motor", category="single"):
    hidden = tuple(Hidden(*name.split("@"), {}) for name in names)
    drive = Drive("multilevel")
    return Case("x", category, machine, "idloop", hidden, (drive,), drive, "open", 100.0, 10.0)


def judge(case, *sets, replaces=None):
    rungs = [Rung(names[0], tuple(names), None, 0.0, 10.0) for names in sets]
    if replaces is not None:
        rungs[-1] = Rung(rungs[-1].name, rungs[-1].set, replaces, 0.0, 10.0)
    return score(case, base_model(case.machine, case.rate, case.loop), rungs)


def test_the_right_effect_alone_is_exact():
    found = judge(case_with("dead_zone@input"), ["dead_zone@input"])
    assert found.found == (True,)
    assert found.exact
    assert found.false == ()


def test_a_larger_set_contains_it_but_is_not_exact():
    found = judge(case_with("dead_zone@input"), ["coulomb_friction@motor", "dead_zone@input"])
    assert found.found == (True,)
    assert not found.exact
    assert found.false == ()


def test_a_wrong_effect_is_false_and_the_right_one_missing():
    found = judge(case_with("dead_zone@input"), ["coulomb_friction@motor"])
    assert found.found == (False,)
    assert found.false == ("coulomb_friction@motor",)


def test_an_effect_on_top_of_the_right_one_is_false():
    found = judge(case_with("dead_zone@input"), ["dead_zone@input"], ["cogging@motor"])
    assert found.found == (True,)
    assert found.false == ("cogging@motor",)


def test_anything_is_false_where_nothing_is_hidden():
    assert judge(case_with(category="clean"), ["input_delay@input"]).false == ("input_delay@input",)


def test_an_effect_that_a_later_one_replaced_is_forgiven():
    found = judge(
        case_with("stribeck_friction@motor"),
        ["coulomb_friction@motor"],
        ["stribeck_friction@motor"],
        replaces="coulomb_friction@motor",
    )
    assert found.found == (True,)
    assert found.false == ()


def test_offset_of_the_command_and_load_on_the_driven_body_are_one_equation():
    found = judge(case_with("input_offset@input"), ["load_torque@motor", "input_offset@input"])
    assert found.exact
    behind_a_dead_zone = case_with("input_offset@input", "dead_zone@input", category="double")
    assert not judge(behind_a_dead_zone, ["load_torque@motor"], ["dead_zone@input"]).found[0]


def test_asymmetric_friction_is_friction_and_a_constant():
    one = case_with("asymmetric_friction@motor")
    assert judge(one, ["coulomb_friction@motor"], ["load_torque@motor"]).found == (True,)
    assert judge(one, ["coulomb_friction@motor"]).found == (False,)
    tied = judge(
        one, ["coulomb_friction@motor"], ["input_offset@input", "load_torque@motor", "asymmetric_friction@motor"]
    )
    assert tied.exact
    two = case_with("coulomb_friction@motor", "input_offset@input", category="double")
    assert judge(two, ["asymmetric_friction@motor"]).found == (True, True)


def test_with_one_sensor_it_does_not_matter_where_time_is_lost():
    assert judge(case_with("input_delay@input", machine="dc_position"), ["sensor_delay@position[motor]"]).exact
    assert not judge(case_with("input_delay@input"), ["sensor_delay@position[motor]"]).found[0]


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    [(0, 10, 0.0, 0.308), (5, 10, 0.187, 0.813), (10, 10, 0.692, 1.0), (98, 100, 0.930, 0.998)],
)
def test_intervals_of_a_share_are_those_of_the_tables(hits, count, low, high):
    assert clopper_pearson(hits, count) == pytest.approx((low, high), abs=6e-4)
