"""The values of a ladder are those that a fit of the same model takes, also where it takes those of a free run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from idloop.diagnosis.candidate import Candidate
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.options import Options
from idloop.diagnosis.refine import _Refinement
from idloop.estimation import fit, greybox
from idloop.estimation.criterion_choice import Choice
from idloop.physics import Model, load_model

from .conftest import record_of


@pytest.mark.parametrize("criterion", ["prediction", "simulation"])
def test_first_and_last_model_have_the_values_of_a_fit_by_free_run(
    start: Model, monkeypatch: pytest.MonkeyPatch, criterion: str
) -> None:
    def chosen(*_: Any) -> Choice:
        return Choice(criterion, "the noise model explains model error")

    monkeypatch.setattr(greybox, "choose_criterion", chosen)
    record = record_of(load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"]), 1, seconds=2.0)
    extended = start.with_effects(["coulomb_friction@axis"])
    added = Candidate("coulomb_friction", "axis", "yes", "", "", model=extended)
    ladder = Ladder((Step(None, start), Step(added, extended)), "adequate", criterion="prediction")
    task = _Refinement(start, [record], [], Options(), 8, None)
    found = task.with_values_of_free_run(start, ladder)
    assert fit(start, [record]).criterion == criterion
    if criterion == "prediction":
        assert found.steps == ladder.steps
        assert found.findings == ()
        return
    for step, model in zip(found.steps, (start, extended), strict=True):
        assert step.model.values == fit(model, [record]).model.values
        assert step.train["fit"]
    last = found.steps[-1].added
    assert last is not None
    assert last.parameters["level"]["value"] == found.model.values["coulomb_friction@axis.level"]
    assert [text.partition(",")[0] for text in found.findings] == ["the values are those of a free run"]


def test_values_whose_free_run_is_worse_on_held_out_records_are_not_taken(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(greybox, "choose_criterion", lambda *_: Choice("simulation", "the noise explains model error"))
    record, held_out = (record_of(load_model("axis"), seed, seconds=2.0) for seed in (1, 2))
    right = load_model("axis").with_effects(["coulomb_friction@axis(level=0.0)"])
    # A record of another machine leads the free run astray.
    other = replace(record, output=0.7 * record.output)
    added = Candidate("coulomb_friction", "axis", "yes", "", "", model=right)
    ladder = Ladder((Step(None, start), Step(added, right)), "adequate", criterion="prediction")
    for validation, kept in (([held_out], True), ([], False)):
        found = _Refinement(start, [other], validation, Options(), 8, None).with_values_of_free_run(start, ladder)
        assert (found.model.values == right.values) is kept


def test_what_explains_less_with_the_values_of_a_free_run_is_not_added(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(greybox, "choose_criterion", lambda *_: Choice("simulation", "the noise explains model error"))
    record = record_of(load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"]), 1, seconds=2.0)
    extended = start.with_effects(["coulomb_friction@axis"])
    added = Candidate("coulomb_friction", "axis", "yes", "", "", model=extended)
    said = (f"{added.name}.level is hardly determined",)
    ladder = Ladder((Step(None, start), Step(added, extended)), "adequate", criterion="prediction", findings=said)
    task = _Refinement(start, [record], [], Options(), 8, None)
    for worse in (True, False):
        monkeypatch.setattr(_Refinement, "_worse", lambda *_, worse=worse: worse)
        found = task.with_values_of_free_run(start, ladder)
        assert found.added == (() if worse else (added.name,))
        assert found.verdict == ("unknown_structure" if worse else "adequate")
        assert any("nothing is added" in text for text in found.findings) is worse
        assert any("hardly determined" in text for text in found.findings) is not worse
        assert [one.name for one in found.candidates] == ([added.name] if worse else [])


def test_what_the_values_of_a_free_run_do_not_determine_is_not_added(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(greybox, "choose_criterion", lambda *_: Choice("simulation", "the noise explains model error"))
    record = record_of(load_model("axis").with_effects(["coulomb_friction@axis(level=0.1)"]), 1, seconds=2.0)
    late = start.with_effects(["sensor_delay@position[axis]"])
    extended = late.with_effects(["coulomb_friction@axis"])
    steps = [Step(None, start)]
    for name, at, model in (("sensor_delay", "position[axis]", late), ("coulomb_friction", "axis", extended)):
        steps.append(Step(Candidate(name, at, "yes", "", "", model=model), model))
    ladder = Ladder(tuple(steps), "adequate", criterion="prediction")
    found = _Refinement(start, [record], [], Options(), 8, None).with_values_of_free_run(start, ladder)
    assert found.added == found.model.effect_names == ("coulomb_friction@axis",)
    assert found.steps[1].model.values == fit(start.with_effects(["coulomb_friction@axis"]), [record]).model.values
    assert found.passed_over["sensor_delay@position[axis]"].startswith("the data do not determine its delay")
