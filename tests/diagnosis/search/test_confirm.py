"""Fits of single effects, and what the noise model absorbs."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.conftest import record_of

from idloop.diagnosis import diagnose
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.screening.score_test import Screen
from idloop.diagnosis.search import confirm
from idloop.diagnosis.search.confirm import Confirmed, refit_under_restricted_noise, search
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import STRENGTH_FACTORS, refit
from idloop.physics import Model, catalogue, load_model
from idloop.physics.effect import built_in


@pytest.mark.parametrize("offset", [0.1, 0.0])
def test_a_constant_force_is_found_beside_a_random_walk(start: Model, offset: float) -> None:
    # Ten samples of memory disturb this run; a walk does as well as long as it may stand for the offset too.
    machine = load_model("axis").with_effects([f"input_offset@input(offset={offset})"])
    record = record_of(machine, 1, seconds=6.0, disturbance=0.02)
    found = diagnose(start, [record], criterion="prediction").set
    assert ("input_offset@input" in found) == (offset > 0.0)


@pytest.mark.slow
def test_a_filter_that_the_noise_model_imitates_is_found_with_the_noise_held_down(start: Model) -> None:
    hidden = "velocity_filter@velocity[axis]"
    machine = load_model("axis").with_effects([f"{hidden}(time_constant=0.04)"])
    estimation = prepare_estimation(start, [record_of(machine, 3, seconds=8.0)], "prediction")
    parent = refit(estimation, start)
    assert parent.whitening_gain > 1.0
    names = [hidden, "sensor_delay@velocity[axis]", "actuator_lag@input", "coulomb_friction@axis"]
    screened = Screen(estimation, parent, 0).all(proposals(parent.model, names), lambda share, text: None)
    found = refit_under_restricted_noise(estimation, parent, screened)
    assert found[0].proposal.name == hidden
    assert found[0].fit.model.values[f"{hidden}.time_constant"] == pytest.approx(0.04, rel=0.01)


@pytest.mark.parametrize(("replaces", "best"), [("coulomb_friction@axis", "stribeck_friction"), (None, "compensation")])
def test_an_effect_that_begins_far_from_its_optimum_is_searched_to_the_end_beside_one_that_looks_like_it(
    monkeypatch: pytest.MonkeyPatch, replaces: str | None, best: str
) -> None:
    """After one round the other one explains far more."""

    def begun(name: str, first: float, last: float, replaced: str | None) -> Confirmed:
        proposal = SimpleNamespace(effect=built_in()[name][0], replaces=replaced)
        fit = SimpleNamespace(log_likelihood=first, model=last)
        return Confirmed(proposal, fit, first, 0.0)  # type: ignore[arg-type]

    def finished(estimation: object, model: float, *others: object, **options: object) -> object:
        return SimpleNamespace(log_likelihood=model)

    monkeypatch.setattr(confirm, "refit_or_none", finished)
    both = [
        begun("friction_compensation", 400.0, 700.0, None),
        begun("stribeck_friction", 0.0, 750.0, replaces),
    ]
    choices = [(one.proposal.effect.name, lambda one=one: one) for one in both]
    found = search(None, SimpleNamespace(log_likelihood=0.0), choices, lambda *_: None)  # type: ignore[arg-type]
    assert best in found[0].proposal.effect.name


@given(st.floats(1e-4, 10.0), st.floats(0.02, 50.0))
def test_a_search_for_backlash_starts_close_to_any_gap(twist: float, gap: float) -> None:
    # What has walls has an optimum wherever they touch at a wrong instant.
    travel = 100.0 * max(gap, 10.0 * twist)
    effect = next(e for e in catalogue()["backlash"] if e.site == "coupling")
    assert effect.trials is not None
    tried = [trial["gap"] for alternative in effect.trials(Sizes(twist, travel)) for trial in alternative]
    reach = (0.1 * twist, 10.0 * twist * 1.4**8)
    if reach[0] <= gap <= reach[1]:
        around = [share * trial for trial in tried for share in (1.0, *STRENGTH_FACTORS)]
        assert min(abs(np.log(gap / place)) for place in around) < np.log(1.3)


class Sizes(NamedTuple):
    twist: float
    span: float
