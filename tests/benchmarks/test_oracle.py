"""What an observer that knows the noise can see, told apart from what nobody can."""

from __future__ import annotations

import pytest
from cases import cases_of
from experiment import experiment
from judge import _free_as, without_rounding
from oracle import HOPELESS, TESTABLE, Oracle


def gain_of(case_id):
    (case,) = cases_of(case_id.__eq__)
    data = experiment(case)
    truth = without_rounding(_free_as(data.truth, data.start))
    return Oracle(truth, data.training, data.truth, walking=case.disturbance.kind == "walk").gain([case.hidden[0].name])


@pytest.mark.slow
@pytest.mark.parametrize(
    "case_id",
    ["single/coulomb_friction/dc_motor/motor/dominant", "single/dead_zone/dc_position/input/clear"],
)
def test_a_clear_effect_is_testable(case_id):
    if "mujoco" in cases_of(case_id.__eq__)[0].simulator:
        pytest.importorskip("mujoco", reason="mujoco is not installed (optional extra 'benchmark')")
    assert gain_of(case_id) > TESTABLE


def test_a_constant_force_is_no_disturbance_where_the_disturbance_is_stationary():
    assert gain_of("single/input_offset/dc_motor/input/dominant") > TESTABLE


def test_a_two_level_command_hides_a_dead_zone():
    assert gain_of("untestable/dead_zone/dc_motor/two_level/clear") < HOPELESS
