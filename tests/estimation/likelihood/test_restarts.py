"""Restarts where contacts make many local optima."""

from __future__ import annotations

import pytest
from tests.diagnosis.conftest import record_of

from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, refit
from idloop.estimation.likelihood.restarts import has_contacts, restart_nearby, search_repeatedly
from idloop.physics import Model, load_model


@pytest.fixture(scope="module")
def play(start: Model) -> tuple[EstimationProblem, Refit]:
    """An axis read through a play, and its model fitted by one search."""
    machine = load_model("axis").with_effects(["backlash@position[axis](gap=0.05)"])
    estimation = prepare_estimation(start, [record_of(machine, 4, seconds=4.0)], "prediction")
    return estimation, refit(estimation, start.with_effects(["backlash@position[axis](gap=0.04)"]))


def test_the_best_of_several_searches_is_never_worse_and_the_same_each_time(
    play: tuple[EstimationProblem, Refit],
) -> None:
    estimation, fit = play
    again = restart_nearby(estimation, fit, seed=1)
    assert again.log_likelihood >= fit.log_likelihood
    assert restart_nearby(estimation, fit, seed=1).log_likelihood == again.log_likelihood
    assert again.model.free == fit.model.free


def test_a_search_from_a_good_optimum_stays_there(start: Model) -> None:
    smooth = prepare_estimation(start, [record_of(load_model("axis"), 4, seconds=4.0)], "prediction")
    fit = refit(smooth, start)
    assert restart_nearby(smooth, fit).log_likelihood == pytest.approx(fit.log_likelihood, abs=0.05)


def test_repeated_searches_leave_a_local_optimum(play: tuple[EstimationProblem, Refit], start: Model) -> None:
    estimation, good = play
    # Beside the disturbance of the model without it, one round leaves the play where it began.
    poor = refit(
        estimation, start.with_effects(["backlash@position[axis](gap=0.02)"]), None, refit(estimation, start), rounds=1
    )
    assert poor.log_likelihood < good.log_likelihood - 20.0
    found = search_repeatedly(estimation, poor)
    assert found.log_likelihood > good.log_likelihood - 4.0
    assert found.model.values["backlash@position[axis].gap"] == pytest.approx(0.05, rel=0.1)


def test_backlash_has_contacts(play: tuple[EstimationProblem, Refit], start: Model) -> None:
    assert has_contacts(play[1].model)
    assert not has_contacts(start.with_effects(["coulomb_friction@axis"]))
