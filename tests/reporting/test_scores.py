"""One object behind every error that is shown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.physics import load_model
from idloop.reporting.page.page import changes, rungs
from idloop.reporting.scores import BETTER, FORCE, FREE_RUN, SAME, WORSE, Score, disagreements, scores_of, step_scores
from idloop.reporting.text.blocks import as_text
from idloop.reporting.text.diagnosis import ladder_blocks
from idloop.reporting.workbench.state_json import _ladder

MODEL = load_model("axis")


def ladder_of(*errors: tuple[float, float | None]) -> Ladder:
    steps = []
    for fit, force in errors:
        added = Candidate("coulomb_friction", "axis", "yes", "", "It rubs.", p_value=1e-4) if steps else None
        errors_of = {"fit": {"axis.position": fit}, "force": force}
        steps.append(Step(added, MODEL, train=errors_of, validation=errors_of))
    return Ladder(tuple(steps), verdict="adequate", criterion="force")


@given(st.floats(-1e5, 100.0), st.floats(0.0, 20.0))
def test_page_report_and_command_line_say_one_number(fit, force):
    ladder = ladder_of((12.5, 0.5), (fit, force))
    score, of_force = (step_scores(ladder.steps[1], "validation")[name] for name in ("axis.position", "drive force"))
    told = {row["name"]: row["after"] for row in changes(ladder)}
    shown = {one["name"]: one["text"] for one in _ladder(ladder, ())["steps"][1]["scores"]}
    for one in (score, of_force):
        assert one.text == told[one.name] == shown[one.name].replace("\u00a0", " ")
        assert one.cell in as_text(ladder_blocks(ladder))
        assert one.cell in rungs(ladder)[1]["errors"]["validation"]


@pytest.mark.parametrize(
    ("view", "before", "after", "trend"),
    (
        (FREE_RUN, 80.0, 90.0, BETTER), (FREE_RUN, 80.0, 70.0, WORSE), (FREE_RUN, 80.0, 80.001, SAME),
        (FORCE, 0.2, 0.1, BETTER), (FORCE, 0.1, 0.2, WORSE), (FORCE, None, 0.1, SAME),
    ),
)  # fmt: skip
def test_a_trend_is_that_of_the_numbers_that_are_read(view, before, after, trend):
    assert Score(view, "x", before).trend(Score(view, "x", after)) == trend


def test_what_is_not_known_is_no_score():
    known = {"fit": {"a": 90.0, "b": 80.0}, "ahead": {"a": 99.96, "b": float("nan")}, "steps": 10}
    assert [one.beside for one in scores_of(known).values()] == ["99.96 % 10 steps ahead", ""]
    assert scores_of({}) == {}
    assert list(scores_of({"fit": {"a": 1.0}, "force": None})) == ["a"]
    assert scores_of({"fit": {"a": float("nan")}})["a"].text == "–"


@pytest.mark.parametrize(
    ("noise", "said"),
    [(0.139, "sensor noise may be all of it"), (0.07, "7 % from sensor noise alone"), (0.001, ""), (None, "")],
)
def test_what_sensor_noise_makes_of_the_force_error_stands_beside_it(noise, said):
    """The model of a machine without any other effect left 13.8 % of the force: all of it noise."""
    score = scores_of({"force": 0.138, "force_noise": noise})["drive force"]
    assert (score.text, score.beside) == ("13.8 %", said)


def test_views_that_disagree_are_said_to():
    better = ladder_of((-15.0, 0.171), (-119.0, 0.072))
    (said,) = disagreements(better)
    assert "free run worse" in said
    assert said in as_text(ladder_blocks(better))
    assert any("free run worse" in text for text in _ladder(better, ())["beware"])
    assert disagreements(ladder_of((10.0, 0.2), (50.0, 0.1))) == []
    assert disagreements(ladder_of((10.0, None), (5.0, 0.1))) == []
    (said,) = disagreements(ladder_of((10.0, 0.1), (50.0, 0.2)))
    assert "free run better" in said
