"""Fits that are far from the nominal values, and effects found by a restart near these."""

import pytest

from idloop.diagnosis import diagnose
from idloop.diagnosis.search.non_local_search import far_from_nominal
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model

from .conftest import record_of


@pytest.mark.parametrize(("factor", "left"), [(0.19, True), (0.21, False), (1.0, False), (4.9, False), (5.1, True)])
def test_an_inertia_is_far_from_nominal_from_a_factor_of_five_on(factor: float, left: bool) -> None:
    axis = load_model("axis")
    moved = axis.with_values({"axis.inertia": factor * axis.values["axis.inertia"]})
    assert far_from_nominal(moved, axis.values) == (["axis.inertia"] if left else [])


def test_parameters_without_nominal_value_or_held_ones_do_not_count() -> None:
    axis = load_model("axis")
    heavy = axis.with_values({"axis.inertia": 10.0 * axis.values["axis.inertia"]})
    assert not far_from_nominal(heavy, {"axis.viscous_friction": 0.05})
    assert not far_from_nominal(heavy.with_free(["axis.viscous_friction"]), axis.values)


@pytest.mark.slow
def test_a_delay_is_found_where_the_fit_is_a_machine_that_its_drive_hardly_moves(start: Model) -> None:
    axis = load_model("axis")
    machine = axis.with_effect("stribeck_friction", "axis", coulomb=0.2, static=0.4, velocity=0.7)
    record = record_of(machine.with_effect("input_delay", "input", delay=0.01), 1, seconds=10.0, disturbance=0.02)
    plain = refit(prepare_estimation(start, [record], "prediction"), start)
    assert plain.model.values["axis.inertia"] > 5.0 * axis.values["axis.inertia"]
    found = diagnose(start, [record], criterion="prediction")
    assert found.set == ("input_delay@input",)
    assert found.best is not None
    assert found.best.p_value < 1e-6
    assert found.best.model is not None
    assert found.best.model.values["input_delay@input.delay"] == pytest.approx(0.01, rel=0.02)
    assert found.best.model.values["axis.inertia"] == pytest.approx(axis.values["axis.inertia"], rel=0.05)


@pytest.mark.slow
def test_a_long_delay_in_a_tight_loop_is_found_far_from_the_fitted_values() -> None:
    from cases import cases_of
    from experiment import experiment

    (case,) = cases_of("single/input_delay/axis/input/dominant".__eq__)
    made = experiment(case)
    found = diagnose(made.start, made.training, effects=["input_delay", "actuator_lag", "compliance"])
    assert found.set == ("input_delay@input",)
    assert found.best is not None
    assert found.best.parameters["delay"]["value"] == pytest.approx(0.02, rel=0.01)
