"""When an estimate may be trusted."""

from dataclasses import replace

import pytest

from idloop.validation.trust import ModelValidation, trust

SOUND = ModelValidation({"axis.position": 1.1, "axis.velocity": 0.98}, weighed=30.0)


def test_an_estimate_with_nothing_against_it_is_trusted_and_says_what_holds() -> None:
    found = trust(2.0, 0.01, SOUND)
    assert found.trusted
    assert "0.5 %" in found.why
    assert "1.1 times the noise" in found.why
    assert "30 s" in found.why


@pytest.mark.parametrize(
    ("standing", "said"),
    [
        (replace(SOUND, missed={}), "not validated"),
        (replace(SOUND, missed={"axis.velocity": 3.5}), "axis.velocity on unseen samples is 3.5 times"),
        (replace(SOUND, missed={"axis.velocity": float("nan")}), "axis.velocity"),
        (replace(SOUND, missing=("dead_zone@input",)), "dead_zone@input"),
        (replace(SOUND, doubtful=("dead_zone@input",)), "undecided effects: dead_zone@input"),
        (replace(SOUND, unknown=True), "not in the catalogue"),
        (replace(SOUND, weighed=0.0), "not tested yet"),
    ],
)
def test_what_speaks_against_the_model_speaks_against_every_estimate(standing: ModelValidation, said: str) -> None:
    found = trust(2.0, 0.01, standing)
    assert not found.trusted
    assert said in found.why


@pytest.mark.parametrize(
    ("value", "stderr", "at_bound", "said"),
    [
        (2.0, 0.2, False, "10 %"),
        (2.0, None, False, "no standard error"),
        (0.0, 0.1, False, "inf"),
        (-2.0, float("nan"), False, "standard error"),
        (2.0, 0.01, True, "bound"),
    ],
)
def test_an_estimate_may_have_doubts_of_its_own(value: float, stderr: float | None, at_bound: bool, said: str) -> None:
    found = trust(value, stderr, SOUND, at_bound=at_bound)
    assert not found.trusted
    assert said in found.why


def test_what_is_enough_is_for_the_reader_to_say() -> None:
    loose, rough = replace(SOUND, missed={"axis.position": 2.5}), trust(2.0, 0.2, SOUND, largest_stderr=0.2)
    assert rough.trusted
    assert not trust(2.0, 0.01, loose).trusted
    assert trust(2.0, 0.01, loose, largest_error=3.0).trusted
