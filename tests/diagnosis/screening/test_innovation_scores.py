"""Scores of unseen samples: large with a hidden effect, zero with an idle one."""

import math

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis.evidence.predictive import Evidence
from idloop.diagnosis.screening.innovation_scores import InnovationScores
from idloop.diagnosis.screening.proposals import proposals
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit
from idloop.physics import Model, load_model

FRICTION = {"level": 0.05}
OFFSET = {"torque": 0.01}


def fits(start: Model, machine: Model, seed: int, name: str, values: dict[str, float]) -> tuple[Refit, Refit]:
    """Of records of a machine, without an effect and with it."""
    estimation = estimation_of(start, machine, seed)
    parent = refit(estimation, start)
    (proposal,) = proposals(parent.model, [f"{name}@axis"])
    return parent, refit(estimation, proposal.model(values), None, parent)


def estimation_of(start: Model, machine: Model, seed: int) -> EstimationProblem:
    return prepare_estimation(start, [record_of(machine, seed, seconds=6.0, disturbance=0.02)], "prediction")


def evidence(parent: Refit, fit: Refit) -> Evidence:
    return InnovationScores(fit).scores().against(InnovationScores(parent).scores())


@pytest.mark.slow
def test_a_hidden_effect_shows_and_an_idle_one_does_not(start: Model) -> None:
    plain = load_model("axis")
    machine = plain.with_effects(["coulomb_friction@axis(level=0.05)"])
    shown = evidence(*fits(start, machine, 1, "coulomb_friction", FRICTION))
    assert shown.log > math.log(30 / 0.01)
    assert shown.distinguishable
    idle = [evidence(*fits(start, plain, seed, "load_torque", OFFSET)).log for seed in range(6)]
    assert max(idle) < math.log(30 / 0.01)
    # Unseen samples ask a parameter that does nothing for its price.
    assert float(np.mean(idle)) < 0.5


def test_a_fold_is_scored_by_the_other_ones(start: Model) -> None:
    parent = refit(estimation_of(start, load_model("axis"), 2), start)
    scores = InnovationScores(parent)
    unseen = float(np.sum(scores.scores().log_density))
    own = InnovationScores(parent)
    own._slopes = np.zeros_like(own._slopes)
    # With fits that know the fold itself each parameter gains about one half, without about as much is lost.
    loss = float(np.sum(own.scores().log_density)) - unseen
    assert 0.0 < loss < 10.0 * parent.parameters


def test_regressors_of_the_errors_are_fitted_beside_the_parameters(start: Model) -> None:
    parent = refit(estimation_of(start, load_model("axis"), 3), start)
    scores = InnovationScores(parent)
    rng = np.random.default_rng(0)
    column = rng.normal(size=(len(scores.errors), 1))
    base = scores.beside(np.zeros((len(scores.errors), 0)))
    assert scores.beside(column).against(base).log < math.log(30 / 0.01)
    scores.errors = scores.errors + 0.2 * column[:, 0]
    assert scores.beside(column).against(scores.beside(np.zeros((len(column), 0)))).log > math.log(30 / 0.01)


@pytest.mark.parametrize("lags", [0, 3])
def test_instants_without_a_past_count_as_average_ones(start: Model, lags: int) -> None:
    estimation = estimation_of(start, load_model("axis"), 4)
    fit = refit(estimation, start, orders=[lags])
    scores = InnovationScores(fit).scores()
    assert len(scores.log_density) == sum(len(errors) for group in fit.problem.errors(fit.point) for errors in group)
    assert sorted(np.concatenate(scores.blocks)) == list(range(len(scores.log_density)))
    assert np.all(np.isfinite(scores.log_density))
