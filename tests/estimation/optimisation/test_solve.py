import numpy as np
import pytest

from idloop.errors import IdloopError
from idloop.estimation.dataset import prepare
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.optimisation.solve import solve
from idloop.estimation.simulation import SimulationCriterion
from idloop.estimation.statistics.covariance import estimate_covariance
from idloop.physics import Engine

START = {"drive.gain": 6.0, "motor.viscous_friction": 3.0, "coulomb_friction@motor.level": 0.5}


@pytest.fixture
def criterion(motor, experiment):
    return SimulationCriterion(Engine(motor), prepare(motor, [experiment(motor, seed=7)]))


def test_a_draft_is_within_a_standard_error(motor, criterion):
    start, evaluations = motor.with_values(START).theta, []
    whole = solve(criterion, start, *motor.bounds)
    assert whole.converged
    point = np.concatenate([whole.theta, whole.nuisance])
    residual = whole.problem.residual(point)
    spread = np.sqrt(np.diag(estimate_covariance(whole.problem, point, residual, whole.jacobian)))[: len(start)]
    simulated = criterion.simulated
    criterion.simulated = lambda *given: evaluations.append(0) or simulated(*given)
    draft = solve(criterion, start, *motor.bounds, draft=True)
    few = len(evaluations)
    assert np.all(np.abs(draft.theta - whole.theta) < spread)
    solve(criterion, start, *motor.bounds)
    assert 1.5 * few < len(evaluations) - few


def test_a_jacobian_is_converted_to_other_weights(motor, criterion):
    problem = LeastSquaresProblem(criterion, len(motor.theta))
    point = np.concatenate([motor.with_values(START).theta, criterion.nuisance()[0]])

    def slopes():
        ahead = [problem.residual(point + step) for step in 1e-5 * np.eye(len(point))]
        return np.column_stack([(moved - problem.residual(point)) / 1e-5 for moved in ahead])

    problem.reweigh(point, whiten=False)
    before, weights = slopes(), problem.weights
    problem.reweigh(np.concatenate([motor.theta, criterion.nuisance()[0]]), whiten=False)
    assert not np.allclose(problem.weights[0], weights[0], rtol=0.5)
    assert problem.reweighted_jacobian(before, weights) == pytest.approx(slopes(), rel=1e-6, abs=1e-5)


def test_a_model_that_only_runs_at_its_start_gives_an_error(motor, criterion):
    start, errors = motor.with_values(START).theta, criterion.errors

    def only_there(theta, nuisance):
        found = errors(theta, nuisance)
        return found if np.array_equal(theta, start) else [[np.full_like(e, np.nan) for e in group] for group in found]

    criterion.errors = only_there
    with pytest.raises(IdloopError, match="narrower bounds"):
        solve(criterion, start, *motor.bounds)
