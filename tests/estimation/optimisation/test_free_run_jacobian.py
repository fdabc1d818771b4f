"""Sensitivity equations are used where differences agree with them, and give the same fit."""

import numpy as np
import pytest

from idloop.estimation.dataset import prepare
from idloop.estimation.greybox import fit
from idloop.estimation.optimisation.free_run_jacobian import FreeRunJacobian
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.simulation import SimulationCriterion
from idloop.physics import Engine, load_model


def slopes_of(model, record):
    criterion = SimulationCriterion(Engine(model), prepare(model, [record]))
    problem = LeastSquaresProblem(criterion, len(model.theta))
    point = np.concatenate([model.theta, criterion.nuisance()[0]])
    problem.reweigh(point, False)
    scale = np.maximum(np.abs(point), 0.1)
    unbounded = np.full(len(point), np.inf)
    return FreeRunJacobian(problem, -unbounded, unbounded, scale, 1e-4 * scale), point


def test_sensitivity_equations_are_used_where_they_agree_with_differences(motor, experiment):
    slopes, point = slopes_of(motor, experiment(motor, seed=3))
    assert slopes.agree(point)
    exact, by_differences = slopes(point), slopes._differences(point)
    assert np.linalg.norm(exact - by_differences) < 0.03 * np.linalg.norm(by_differences)
    assert not np.array_equal(exact, by_differences)


def test_sensitivity_equations_do_not_agree_at_a_break_away(experiment):
    """A level of breakaway that the friction leaves at once acts through that instant alone."""
    sharp = {"coulomb": 0.3, "static": 1.5, "velocity": 0.05}
    model = load_model("dc_motor").with_effect("stribeck_friction", "motor", **sharp)
    slopes, point = slopes_of(model, experiment(model, seed=3))
    assert not slopes.agree(point)


def test_a_model_without_sensitivity_equations_has_differences(motor, experiment):
    model = motor.with_effect("actuator_lag", "input", time_constant=0.03)
    slopes, point = slopes_of(model, experiment(model, seed=3))
    assert not slopes.agree(point)
    np.testing.assert_array_equal(slopes(point), slopes._differences(point))


@pytest.mark.parametrize(
    "effect",
    ["coulomb_friction@motor(level=0.8)", "quadratic_drag@motor(coefficient=0.1)", "dead_zone@input(width=0.3)"],
)
def test_a_long_record_is_fitted_the_same_without_sensitivity_equations(experiment, monkeypatch, effect):
    model = load_model("dc_motor").with_effects([effect])
    record = experiment(model, samples=8000, seed=6)
    start = model.with_values({"drive.gain": 6.0, "motor.viscous_friction": 3.0})
    asked = []
    slopes = Engine.slopes
    monkeypatch.setattr(Engine, "slopes", lambda *given: asked.append(0) or slopes(*given))
    quick = fit(start, [record], "simulation")
    assert len(asked) > 1  # once to compare, and then in the search
    monkeypatch.setattr(Engine, "slopes", lambda *given: None)
    slow = fit(start, [record], "simulation")
    assert np.all(np.abs(quick.values - slow.values) < 0.1 * slow.stderr)
    np.testing.assert_allclose(quick.stderr, slow.stderr, rtol=0.05)
