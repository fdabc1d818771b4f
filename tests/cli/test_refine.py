"""`idloop refine`: the ladder, its folder, going on, taking back, the user's own choice."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.cli import main
from idloop.errors import IdloopError
from idloop.physics import load_model
from idloop.records import read_record, write_bag
from idloop.signals import build_signal

# Where it does not matter how many effects are weighed.
FEW = ("--effects", "dead_zone", "coulomb_friction")


def words(*arguments: object) -> list[str]:
    return [str(argument) for argument in arguments]


@pytest.fixture
def ladder(refined, tmp_path):
    """Copy of the ladder to work on."""
    return shutil.copytree(refined, tmp_path / "ladder")


def document(folder):
    return json.loads((folder / "ladder.json").read_text(encoding="utf-8"))


def added(folder) -> list[str]:
    return [f"{s['added']['effect']}@{s['added']['at']}" for s in document(folder)["ladder"][1:]]


def test_the_folder_holds_model_ladder_and_figures(refined):
    found = document(refined)
    assert found["schema"] == "idloop/refine/1"
    assert added(refined) == ["dead_zone@input"]
    first, last = found["ladder"]
    for kind in ("train", "validation"):
        assert last[kind]["nrmse"]["motor.velocity"] < 0.3 * first[kind]["nrmse"]["motor.velocity"]
    assert last["p_value"] < 0.01
    assert last["set"] == ["dead_zone@input"]
    model = load_model(refined / "model.yaml")
    assert model.values["dead_zone@input.width"] == pytest.approx(0.4, abs=0.02)
    for name in ("ladder.png", "compare.png"):
        assert (refined / name).stat().st_size > 10_000


def test_nothing_is_overwritten_unasked(refined, hidden, capsys):
    before = (refined / "ladder.json").read_bytes()
    assert main.run(words("refine", hidden.model, hidden.levels, "--output", refined)) == 2
    assert "--force" in capsys.readouterr().err
    assert (refined / "ladder.json").read_bytes() == before


@pytest.mark.slow
def test_it_ends_with_the_last_models_parameters_in_units(hidden, capsys):
    asked = words("refine", hidden.model, hidden.levels, *FEW, "--no-suggest")
    assert main.run(asked) == 0
    out = capsys.readouterr().out
    table = out.partition("parameters of the last model, all refitted:\n")[2].splitlines()
    assert table[0].split() == ["parameter", "value", "95", "%", "interval", "unit"]
    rows = {line.split()[0]: line for line in table[2:]}
    assert {"motor.viscous_friction", "drive.gain", "dead_zone@input.width"} == set(rows)
    assert rows["dead_zone@input.width"].endswith(" V")
    assert main.run([*asked, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    width = found["parameters"]["dead_zone@input.width"]
    low, high = width["interval"]
    assert low < 0.4 < high
    assert f"{low:.5g} .. {high:.5g}" in rows["dead_zone@input.width"]
    assert {one["output"] for one in found["residual"]} == {"motor.position", "motor.velocity"}


@pytest.mark.slow
def test_refine_and_diagnose_say_alike_that_what_is_left_is_not_white(hidden, tmp_path, capsys):
    """Noise with a memory is no effect, and no white noise either."""
    record = read_record(hidden.levels, load_model(hidden.model))
    white = np.random.default_rng(1).normal(size=record.output.shape)
    coloured = lfilter([1.0], [1.0, -0.9], white, axis=0) * (0.003, 0.015)
    bag = write_bag(tmp_path / "coloured", replace(record, output=record.output + coloured))
    folder = tmp_path / "run"
    assert main.run(words("refine", hidden.model, bag, *FEW, "--output", folder)) == 0
    refined = capsys.readouterr().out.splitlines()
    assert main.run(words("diagnose", folder / "model.yaml", bag, *FEW)) == 0
    diagnosed = capsys.readouterr().out.splitlines()
    said = [line for line in refined if line.startswith("but the one-step error")]
    assert "is not white" in " ".join(said) or "are not white" in " ".join(said)
    assert set(said) <= set(diagnosed)
    verdict = next(line for line in refined if line.startswith("verdict: "))
    # To the diagnosis the dead zone is no effect to look for: its model has it.
    assert verdict.count("only dead zone and Coulomb friction were") == 1
    only = verdict.removeprefix("verdict: ").replace("dead zone and Coulomb friction were", "Coulomb friction was")
    assert only in diagnosed


@pytest.mark.slow
def test_a_step_is_taken_back(ladder, capsys):
    assert main.run(words("refine", "--resume", ladder, "--undo")) == 0
    assert added(ladder) == []
    assert load_model(ladder / "model.yaml").effect_names == ()
    said = capsys.readouterr().out
    assert "stopped before the end" in said
    assert "taken back: dead_zone@input (kept in " in said
    assert main.run(words("refine", "--resume", ladder, "--undo")) == 2
    assert "nothing to undo" in capsys.readouterr().err


@pytest.mark.slow
def test_several_steps_are_taken_back_at_once_and_none_is_lost(ladder, capsys):
    arguments = ("--add", "coulomb_friction@motor", "--most", 2, *FEW, "--no-suggest")
    assert main.run(words("refine", "--resume", ladder, *arguments)) == 0
    both = document(ladder)
    names = ["dead_zone@input", "coulomb_friction@motor"]
    assert added(ladder) == names
    assert main.run(words("refine", "--resume", ladder, "--undo", "--undo", "--undo")) == 2
    assert f"only 2 effects were added ({', '.join(names)})" in capsys.readouterr().err
    assert added(ladder) == names
    assert main.run(words("refine", "--resume", ladder, "--undo", "--undo", "--json")) == 0
    assert json.loads(capsys.readouterr().out)["taken_back"] == names
    assert added(ladder) == []
    arguments = ("--add", "coulomb_friction@motor", "--most", 1, *FEW, "--no-suggest")
    assert main.run(words("refine", "--resume", ladder, *arguments)) == 0
    assert main.run(words("refine", "--resume", ladder, "--undo")) == 0
    first, second = document(ladder)["taken_back"]
    assert (first["steps"], second["steps"]) == (names, ["coulomb_friction@motor"])
    assert first["ladder"]["ladder"] == both["ladder"]


@pytest.mark.slow
def test_the_user_may_take_another_effect(ladder, capsys):
    arguments = ("--undo", "--add", "coulomb_friction@motor", "--most", 1, *FEW, "--no-suggest", "--json")
    assert main.run(words("refine", "--resume", ladder, *arguments)) == 0
    found = json.loads(capsys.readouterr().out)
    assert [s["chosen_by"] for s in found["ladder"][1:]] == ["user"]
    assert added(ladder) == ["coulomb_friction@motor"]


@pytest.mark.slow
def test_a_ladder_is_gone_on_with_from_where_it_was_left(hidden, tmp_path, capsys):
    folder = tmp_path / "begun"
    begin = words("refine", hidden.model, hidden.levels, "--most", 0, *FEW, "--no-suggest", "--output", folder)
    assert main.run(begin) == 0
    assert added(folder) == []
    assert document(folder)["bags"] == [str(hidden.levels)]
    assert main.run(words("refine", "--resume", folder, *FEW)) == 0
    assert added(folder) == ["dead_zone@input"]
    out = capsys.readouterr().out
    for word in ("start", "+ dead_zone@input", "FIT % motor.velocity", "± ", "nothing significant is left"):
        assert word in out


@pytest.mark.slow
def test_what_stays_open_gets_an_experiment(hidden, tmp_path, capsys):
    folder = tmp_path / "open"
    limits = ("--max-command", 1.5, "--duration", 4)
    assert main.run(words("refine", hidden.model, hidden.two, *FEW, "--output", folder, *limits)) == 0
    found = document(folder)
    assert found["verdict"] == "not_excited"
    suggested = found["suggested_experiment"]
    assert suggested["discrimination"] > 10.0
    assert abs(build_signal(**suggested["signal"]).value).max() <= 1.5 + 1e-9
    out = capsys.readouterr().out
    assert "next experiment: " in out
    assert "this data cannot show dead_zone@input" in out
    assert "adds_to: command" in (folder / "next.yaml").read_text(encoding="utf-8")
    figure = folder / "next.png"
    assert figure.stat().st_size > 10_000
    again = words("refine", "--resume", folder, *FEW, "--no-suggest", "--most", 0)
    assert main.run(again) == 0
    assert figure.exists()
    (folder / "next.yaml").write_text("# another experiment", encoding="utf-8")
    assert main.run(again) == 0
    assert not figure.exists()


def test_no_experiment_is_worked_out_when_none_is_wanted(hidden, capsys):
    assert main.run(words("refine", hidden.model, hidden.two, *FEW, "--no-suggest", "--json")) == 0
    assert json.loads(capsys.readouterr().out)["suggested_experiment"] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        ([], "MODEL"),
        (["MODEL"], "BAG"),
        (["MODEL", "nowhere"], "nowhere"),
        (["MODEL", "BAG", "--undo"], "--resume"),
        (["--resume", "nowhere"], "ladder.json"),
        (["MODEL", "BAG", "--add", "dead_zone", "--no-suggest"], "NAME@SITE"),
        (["MODEL", "BAG", "--output", "nowhere/deep"], "nowhere"),
        (["MODEL", "BAG", "--max-command", "-1"], "command"),
        (["MODEL", "BAG", "--position-range", "2", "1"], "lower end"),
    ),
)
def test_wrong_use_is_one_line(arguments, word, hidden, capsys):
    places = {"MODEL": hidden.model, "BAG": hidden.levels}
    assert main.run(["refine", *(str(places.get(a, a)) for a in arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert word in err


def test_a_broken_ladder_is_said(ladder, capsys):
    whole = (ladder / "ladder.json").read_text(encoding="utf-8")
    (ladder / "ladder.json").write_text('{"schema": "idloop/refine/1"}', encoding="utf-8")
    assert main.run(words("refine", "--resume", ladder)) == 2
    assert "not a whole ladder" in capsys.readouterr().err
    document = json.loads(whole)
    for change in ({"model_folder": 7.5}, {"bags": [1]}, {"unseen": [{"bag": "x"}]}, {"provenance": 3}, {"seen": 1}):
        (ladder / "ladder.json").write_text(json.dumps(document | change), encoding="utf-8")
        assert main.run(words("refine", "--resume", ladder)) == 2, change
        assert "not a whole ladder" in capsys.readouterr().err
    (ladder / "ladder.json").write_text("{", encoding="utf-8")
    assert main.run(words("refine", "--resume", ladder)) == 2
    assert "not valid JSON" in capsys.readouterr().err


@pytest.mark.slow
def test_what_was_found_is_told_although_the_last_model_runs_away(hidden, monkeypatch, capsys):
    def runs_away(*arguments):
        raise IdloopError("neither free run nor prediction of model 'dc_motor' stays finite")

    monkeypatch.setattr("idloop.reporting.residual_findings.findings_on_records", runs_away)
    assert main.run(words("refine", hidden.model, hidden.levels, *FEW, "--no-suggest")) == 1
    said = capsys.readouterr()
    assert "+ dead_zone@input" in said.out
    assert "parameters of the last model" in said.out
    assert said.err.strip().splitlines()[-1].endswith("stays finite")
