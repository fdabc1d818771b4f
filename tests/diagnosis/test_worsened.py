"""Steps that a ladder keeps although the free run is worse with them."""

import pytest

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.worsened import worsened
from idloop.physics import load_model

MODEL = load_model("axis")


def step(name, error, force=None, unseen=None):
    added = None
    if name is not None:
        added = Candidate.from_dict({"effect": name, "at": "axis", "p_value": 1e-9, "parameters": {}})
    train = {"nrmse": {"axis.position": error}, "force": force}
    validation = {} if unseen is None else {"nrmse": {"axis.position": unseen}, "force": force}
    return Step(added, MODEL, train=train, validation=validation)


def test_a_step_that_worsens_the_unseen_motion_is_reported():
    ladder = Ladder((step(None, 0.2, unseen=0.2), step("coulomb_friction", 0.1, unseen=0.1),
                     step("cogging", 0.1, unseen=0.9)))  # fmt: skip
    (found,) = ladder.worsened
    assert found.name == "cogging@axis"
    assert (found.before, found.after) == (0.1, 0.9)
    assert "of axis.position on data that no fit saw worse, FIT 10 % after 90 %" in found.text
    assert ladder.to_dict()["worsened"] == [
        {"effect": "cogging@axis", "unseen": True, "output": "axis.position", "before": 0.1, "after": 0.9},
    ]


def test_a_run_that_has_drifted_before_does_not_count():
    assert Ladder((step(None, 0.8), step("input_offset", 1.4))).worsened == []


@pytest.mark.parametrize("last", [0.05, 0.1, 0.12, float("nan")])
def test_changes_within_chance_do_not_count(last):
    assert Ladder((step(None, 0.1), step("cogging", last))).worsened == []


def test_without_validation_the_fitted_data_decide():
    (found,) = Ladder((step(None, 0.1), step("cogging", 0.2))).worsened
    assert not found.unseen
    assert "on the fitted data" in found.text


@pytest.mark.parametrize(("position", "reported"), [(0.054, ["axis.position"]), (0.006, [])])
def test_an_output_with_a_bad_fit_does_not_mask_another(position, reported):
    def errors(position, velocity):
        return {"nrmse": {"axis.position": position, "axis.velocity": velocity}, "force": None}

    found = worsened(["", "velocity_filter@axis"], [errors(0.002, 0.3), errors(position, 0.2)], unseen=True)
    assert [one.output for one in found] == reported


@pytest.mark.parametrize(("force", "reported"), [(0.3, 0), (0.4, 1)])
def test_a_drifting_free_run_does_not_count_where_the_force_error_falls(force, reported):
    ladder = Ladder((step(None, 0.1, force=0.4), step("input_offset", 0.3, force=force)))
    assert len(ladder.worsened) == reported


@pytest.mark.parametrize(("anew", "reported"), [(0.05, 0), (0.08, 0), (0.09, 1), (None, 1)])
def test_a_run_that_only_a_disturbance_moves_does_not_count(anew, reported):
    def errors(whole, stretches):
        found = {"nrmse": {"axis.position": whole}, "force": None}
        return found if stretches is None else found | {"anew": {"axis.position": stretches}}

    assert len(worsened(["", "coulomb_friction@axis"], [errors(0.1, 0.08), errors(0.2, anew)], unseen=True)) == reported
