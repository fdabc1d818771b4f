"""What the page adds is fitted to its end, and what a fit has changed is a step of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idloop.diagnosis import Candidate, Diagnosis, Ladder, Step
from idloop.diagnosis.identifiability import Gate
from idloop.errors import InputError
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.reporting.text.comparison import brief_map
from idloop.reporting.workbench import state_json
from idloop.reporting.workbench.files import commands
from idloop.reporting.workbench.offline import OfflineSource
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.state import Snapshot
from idloop.reporting.workbench.state_json import page_state
from idloop.reporting.workbench.steps import Study, add, find_missing
from idloop.validation import compare

FRICTION, DRAG = "coulomb_friction@motor", "quadratic_drag@motor"


def silent(share, text):
    pass


def recorded(count=200):
    model = load_model("dc_motor")
    time = 0.01 * np.arange(count)
    command = np.where((time % 1.0) < 0.5, 2.0, -2.0)
    output = simulate(model, time, command, time).output
    units = tuple(one.unit for one in model.outputs)
    return Record("run1", time, command, time, output, "motor.effort", "V", tuple(model.output_names), units)


def diagnosed(model):
    """Friction was chosen and fitted to its end; of drag there is a trial fit, without a standard error."""
    plain = Candidate("coulomb_friction", "motor", "yes", "", "It rubs.", 90.0, 1e-9, 0.8,
                      model=model.with_effects([FRICTION]))  # fmt: skip
    trial = replace(plain, effect="quadratic_drag", model=model.with_effects([DRAG]), p_value=1e-4)
    return Diagnosis(model, (plain, trial), (FRICTION,), "missing", Gate((), {}, {}), None, "prediction", 0.01)


def test_an_effect_that_was_only_tried_is_fitted_when_it_is_added(monkeypatch):
    model, record = load_model("dc_motor"), recorded()
    ladder, fitted = Ladder((Step(None, model),)), []

    def add_effect(before, name, *records, **options):
        fitted.append(name)
        return replace(before, steps=(*before.steps, Step(None, model, chosen_by="user")))

    monkeypatch.setattr("idloop.diagnosis.add_effect", add_effect)
    found = diagnosed(model)
    add(Study((record,)), model, ladder, found, DRAG, silent)
    assert fitted == [DRAG]
    chosen = add(Study((record,)), model, ladder, found, FRICTION, silent)
    assert fitted == [DRAG]  # a diagnosis fits what it chooses
    assert chosen.steps[-1].chosen_by == "diagnosis"


def test_what_the_first_fit_has_changed_is_a_row_of_its_own(monkeypatch):
    given, record = load_model("dc_motor"), recorded()
    signals = Signals(given, capacity=200)
    name = given.parameters[0].name
    fitted = given.with_values({name: 1.3 * given.values[name]})
    monkeypatch.setattr("idloop.diagnosis.diagnose", lambda *_, **__: diagnosed(fitted))
    said = []
    found = find_missing(Study((record,)), given, None, lambda share, text: said.append(text))
    assert said[0] == "first the model is fitted to run1"
    assert found.given is not None
    assert found.given.train["nrmse"] != found.ladder.steps[0].train["nrmse"]
    shown = page_state(Snapshot(model=fitted, ladder=found.ladder, given=found.given, reason="fitted"), signals)
    assert shown["reason"] == "fitted"
    assert [one["text"] for one in shown["ladder"]["given"]] != [
        one["text"] for one in shown["ladder"]["steps"][0]["scores"]
    ]
    assert shown["ladder"]["steps"][0]["by"] == "the same model, fitted"
    again = find_missing(Study((record,)), fitted, found.ladder, silent)
    assert again.given is None  # nothing is fitted a second time


def test_the_worst_stretch_is_that_of_the_command_line():
    """A stretch with much error in much time is none: page, figure and `idloop compare` count by one rule."""
    record = recorded(3000)
    pushed = record.output.copy()
    pushed[1000:1040] += 0.3
    pushed[2000:2250, 0] += 0.1 * np.sin(np.linspace(0.0, np.pi, 250))
    found = compare(load_model("dc_motor"), replace(record, output=pushed)).where
    for one in found.maps:
        said = [line for line in brief_map(one, 2) if "worst:" in line]
        shown = state_json._map(one)["stretches"]
        assert [f"{s['start']:.3f} .. {s['stop']:.3f} s" for s in shown[: len(said)]] == [
            line.partition("worst: ")[2].partition(" (")[0] for line in said
        ]
        assert len(shown) <= len(one.loud_stretches)
    assert any(one.loud_stretches for one in found.maps)


def test_what_is_taken_along_is_named_by_whole_paths_and_says_where_it_comes_from(tmp_path, monkeypatch):
    bag = tmp_path / "with space" / "run1"
    bag.mkdir(parents=True)
    (bag / "data").write_text("1 2 3")
    monkeypatch.chdir(tmp_path)
    model, record, asked = load_model("dc_motor"), recorded(), []
    monkeypatch.setattr(OfflineSource, "_assess", lambda source: None)
    source = OfflineSource(model, Study((record,), seed=7), paths=((Path("with space/run1"),), ()))
    source.close()
    source.state.change(ladder=Ladder((Step(None, model),)))
    snapshot = source.state.snapshot
    assert f"idloop compare model.yaml '{bag}'" in commands(snapshot)

    def gather(ladder, records, validation, **options):
        asked.append(options["provenance"])
        raise InputError("enough")

    monkeypatch.setattr("idloop.reporting.page.contents.gather", gather)
    with pytest.raises(InputError, match="enough"):
        source.file("report.html")
    (origin,) = asked
    assert origin["commands"] == commands(snapshot)
    assert origin["seed"] == 7
    assert [one["path"] for one in origin["bags"]] == [str(bag)]
    assert len(origin["bags"][0]["sha256"]) == 64
