"""Two views of one model that both found nothing: the stricter verdict, and what each of them can show."""

from __future__ import annotations

import pytest

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.ladder import Ladder, Step
from idloop.physics import load_model


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
