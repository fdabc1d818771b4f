"""Two views of one model that both found nothing: the stricter verdict, and what each of them can show."""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace

import pytest

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.diagnosis import Diagnosis
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.options import Options
from idloop.diagnosis.refine import _Refinement
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import load_model

from .conftest import record_of


def candidate(effect: str, testable: str, why: str) -> Candidate:
    return Candidate(effect, "axis", testable, why, "")


def ladder(verdict: str, *candidates: Candidate) -> Ladder:
    untestable = tuple(one.name for one in candidates if one.testable == "no")
    return Ladder((Step(None, load_model("axis")),), verdict, candidates, untestable)


BALANCE = (candidate("coulomb_friction", "yes", "force"), candidate("compliance", "no", "force does not see it"))
PREDICTIONS = (candidate("compliance", "weak", "prediction"), candidate("backlash", "no", "prediction"))


def test_each_view_answers_for_what_it_sees():
    found = ladder("adequate", *BALANCE).merged_with(ladder("adequate", *PREDICTIONS)).candidates
    why = {one.effect: one.why for one in found}
    assert why == {
        "coulomb_friction": "force",
        "compliance": "prediction",
        "backlash": "prediction",
    }


@pytest.mark.parametrize(
    ("first", "second", "both"),
    [
        ("adequate", "adequate", "adequate"),
        ("adequate", "not_excited", "not_excited"),
        ("unknown_structure", "adequate", "unknown_structure"),
        ("adequate", "unknown_structure", "unknown_structure"),
    ],
)
def test_the_stricter_verdict_stands(first: str, second: str, both: str):
    found = ladder(first, *BALANCE).merged_with(ladder(second, *PREDICTIONS))
    assert found.verdict == both
    assert found.untestable == ()


@pytest.mark.parametrize("torque", [0.0, 0.05])
def test_what_the_balance_named_and_precise_predictions_do_not_see_is_no_step(torque: float) -> None:
    plain = load_model("axis")
    machine = plain.with_effects([f"load_torque@axis(torque={torque})"])
    record = record_of(machine, 4)
    named = plain.with_effects(["load_torque@axis(torque=0.05)"])
    named = named.with_values({}, {"load_torque@axis.torque": 0.01})  # standard error of the balance
    candidate = Candidate("load_torque", "axis", "yes", "", "")
    ladder = Ladder((Step(None, plain), Step(candidate, named)), criterion="force")
    task = _Refinement(plain, [record], (), Options(), 8, None)
    estimation = prepare_estimation(named, [record], "prediction")
    found, fit = task._without_unseen(ladder, estimation, refit(estimation, named))
    assert bool(found.added) is bool(torque)
    assert fit.model.effect_names == found.added


@pytest.mark.parametrize(("level", "taken"), [(0.2, True), (0.05, False)])
def test_predicted_values_that_leave_more_of_the_force_are_not_taken(
    level: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A balance that leaves next to nothing contradicts nothing; it still knows the force better."""
    module = import_module("idloop.diagnosis.diagnose")
    machine = load_model("axis").with_effects(["coulomb_friction@axis(level=0.2)"])
    record = record_of(machine, 4)
    predicted = machine.with_values({"coulomb_friction@axis.level": level})
    refitted = SimpleNamespace(model=predicted, with_stderr=lambda: predicted)
    monkeypatch.setattr(module, "refit_or_none", lambda *_, **__: refitted)
    one = Candidate("coulomb_friction", "axis", "yes", "", "", model=machine)
    found = Diagnosis(machine, (one,), (one.name,), "missing", Gate((), {}, {}), None, "force", 0.01)
    balance = SimpleNamespace(model_error_dominates=False, contradicts=lambda model: False)
    (after,) = module._with_predicted_values(found, balance, SimpleNamespace(records=[record])).candidates
    assert after.model is (predicted if taken else machine)


@pytest.mark.parametrize("held_out", [True, False])
def test_values_of_a_balance_that_held_out_records_refute_give_way_to_predicted_ones(held_out: bool) -> None:
    """Along a body that stands for half of the time a balance may be wrong."""
    true = load_model("axis").with_effects(["coulomb_friction@axis(level=0.2)"])
    record, other = record_of(true, 4), record_of(true, 5)
    wrong = true.with_values({"coulomb_friction@axis.level": 0.02})
    candidate = Candidate("coulomb_friction", "axis", "yes", "", "")
    ladder = Ladder((Step(None, load_model("axis")), Step(candidate, wrong)), criterion="force")
    nothing_else = SimpleNamespace(choices=lambda model: [])
    asked: list[bool] = []
    view = SimpleNamespace(
        estimation=prepare_estimation(wrong, [record], "prediction"),
        beside=lambda model, *, balanced: asked.append(balanced) or nothing_else,
    )
    balance = SimpleNamespace(model_error_dominates=True, contradicts=lambda model: False, usable=True)
    task = _Refinement(true, [record], [other] if held_out else [], Options(), 8, None)
    found = task._beyond_force(view, ladder, balance)
    level = found.model.values["coulomb_friction@axis.level"]
    assert level == pytest.approx(0.2 if held_out else 0.02, rel=0.02)
    assert not (held_out and asked[0])
