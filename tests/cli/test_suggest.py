"""`idloop suggest`: rivals from models, a ladder, a diagnosis or an effect; limits; the file for the excitation."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from idloop.cli import main
from idloop.control import check_controller
from idloop.diagnosis.design.experiment import Experiment
from idloop.physics import load_model
from idloop.records import write_bag
from idloop.signals import build_signal


def words(*arguments: object) -> list[str]:
    return [str(argument) for argument in arguments]


@pytest.fixture(scope="module")
def rivals(hidden, tmp_path_factory):
    """Two model files that a two-level command cannot tell apart."""
    folder = tmp_path_factory.mktemp("rivals")
    for effect in ("dead_zone@input(width=0.3)", "saturation@input(limit=1.7)"):
        load_model(hidden.model).with_effects([effect]).save(folder / f"{effect.partition('@')[0]}.yaml")
    return folder / "dead_zone.yaml", folder / "saturation.yaml"


@pytest.mark.slow
def test_the_experiment_is_a_file_that_builds_a_signal(hidden, rivals, tmp_path, capsys):
    file, figure = tmp_path / "next.yaml", tmp_path / "next.png"
    limits = ("--max-command", 1.8, "--position-range", -2, 2, "--duration", 4)
    arguments = words("suggest", *rivals, hidden.two, *limits, "--output", file, "--plot", figure, "--json")
    assert main.run(arguments) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "idloop/suggest/1"
    assert document["plot"] == str(figure)
    assert figure.stat().st_size > 10_000
    assert document["discrimination"] > 10.0
    assert [outcome["rival"] for outcome in document["outcomes"]] == ["dead_zone@input", "saturation@input"]
    text = file.read_text(encoding="utf-8")
    assert "# if dead_zone@input:" in text
    written = YAML(typ="safe").load(text)
    assert set(written) == {"signal", "adds_to"}
    signal = build_signal(**written["signal"])
    np.testing.assert_array_equal(signal.value, build_signal(**document["signal"]).value)
    assert np.max(np.abs(signal.value)) <= 1.8 + 1e-9
    assert signal.duration == pytest.approx(4.0)
    assert main.run(arguments) == 2
    assert "--force" in capsys.readouterr().err


def test_rivals_may_be_named_as_a_pair_and_taken_as_they_are(hidden, rivals, capsys):
    pair = words("suggest", "--between", *rivals, hidden.two, "--no-fit", "--duration", 3)
    assert main.run(pair) == 0
    out = capsys.readouterr().out
    assert "expected to tell dead_zone@input and saturation@input apart" in out
    rows = out.partition("if this is right")[2].splitlines()[2:]
    assert [row.split()[:2] for row in rows[:2]] == [
        ["dead_zone@input", "saturation@input"],
        ["saturation@input", "dead_zone@input"],
    ]


@pytest.mark.slow
def test_one_model_is_diagnosed_first(hidden, capsys):
    assert main.run(words("suggest", hidden.model, hidden.two, "--duration", 4, "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["text"].startswith("this data cannot show dead_zone@input")
    assert document["discrimination"] > 10.0


def test_an_effect_is_made_visible(hidden, capsys):
    shown = ("--show", "backlash@position[motor]", "--duration", 3)
    assert main.run(words("suggest", hidden.model, hidden.two, *shown)) == 0
    out = capsys.readouterr().out
    assert any(
        line.startswith("backlash@position[motor] ") for line in out.partition("if this is right")[2].splitlines()
    )


@pytest.mark.slow
def test_where_nothing_is_open_nothing_is_suggested(hidden, tmp_path, capsys):
    folder, file, figure = tmp_path / "ladder", tmp_path / "next.yaml", tmp_path / "next.png"
    few = ("--effects", "dead_zone", "coulomb_friction")
    assert main.run(words("refine", hidden.model, hidden.levels, *few, "--output", folder)) == 0
    capsys.readouterr()
    assert main.run(words("suggest", "--ladder", folder, "--output", file, "--plot", figure, "--json")) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["experiment"] is document["output"] is document["plot"] is None
    assert err.count("not written") == 2
    assert not file.exists()
    assert not figure.exists()


def test_it_says_what_the_data_cannot_show_where_nothing_ties(refined, capsys):
    document = json.loads((refined / "ladder.json").read_text(encoding="utf-8"))
    assert document["untestable"]
    assert main.run(words("suggest", "--ladder", refined, "--json")) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["experiment"] is None
    assert list(answer["untestable"]) == document["untestable"]
    for name, why in answer["untestable"].items():
        assert f"{name}: {why}" in answer["reason"]
    assert "--max-command" in answer["reason"]


@pytest.fixture(scope="module")
def one_equation(hidden, tmp_path_factory):
    """Two model files that are one equation."""
    folder = tmp_path_factory.mktemp("one_equation")
    for effect in ("input_offset@input(offset=0.1)", "load_torque@motor(torque=0.1)"):
        load_model(hidden.model).with_effects([effect]).save(folder / f"{effect.partition('@')[0]}.yaml")
    return folder / "input_offset.yaml", folder / "load_torque.yaml"


@pytest.mark.slow
def test_effects_that_are_one_equation_get_a_check_by_hand_and_no_experiment(hidden, one_equation, tmp_path, capsys):
    file = tmp_path / "next.yaml"
    arguments = words("suggest", *one_equation, hidden.two, "--output", file)
    assert main.run(arguments) == 0
    out, err = capsys.readouterr()
    assert "no motion can tell input_offset@input and load_torque@motor apart" in out
    assert "by hand: with the load off and the command at zero" in out
    assert f"--output {file}: not written" in err
    assert not file.exists()
    assert main.run([*arguments, "--json"]) == 0
    (group,) = json.loads(capsys.readouterr().out)["one_equation"]
    assert group["effects"] == ["input_offset@input", "load_torque@motor"]


@pytest.mark.slow
def test_an_experiment_that_would_say_nothing_is_not_written(hidden, one_equation, tmp_path, capsys):
    """Taken as they are, a fitted load and an offset of the same force differ in nothing that moves."""
    offset, load = (load_model(path) for path in one_equation)
    values = {name: value for name, value in load.values.items() if name in offset.values}
    values["input_offset@input.offset"] = load.values["load_torque@motor.torque"] / load.values["drive.gain"]
    same = tmp_path / "same.yaml"
    offset.with_values(values).save(same)
    arguments = words("suggest", same, one_equation[1], hidden.two, "--no-fit", "--duration", 3)
    assert main.run([*arguments, "--plot", str(tmp_path / "next.png")]) == 0
    out, err = capsys.readouterr()
    assert "is expected to tell input_offset@input and load_torque@motor apart (at best 0.0" in out
    assert "not written" in err
    assert not (tmp_path / "next.png").exists()


LAW = {"type": "p", "output": "motor.position", "kp": 2.0, "sample_time": 0.01}


@pytest.fixture(scope="module")
def closed(hidden, rivals, tmp_path_factory):
    """Bag of a closed loop; beside it a model whose controller reads what is not measured."""
    folder = tmp_path_factory.mktemp("closed")
    signal = {"name": "multilevel", "sample_time": 0.01, "duration": 6.0, "amplitude": 1.0, "seed": 3}
    experiment = Experiment(signal, "reference", LAW)
    replace(load_model(hidden.model), controller=LAW | {"output": "motor.effort"}).save(folder / "blind.yaml")
    return write_bag(folder / "closed", experiment.run(load_model(rivals[0]), noise=True, seed=1))


def test_a_closed_loop_needs_its_controller_and_says_so_in_one_line(rivals, closed, tmp_path, capsys):
    bag = closed
    assert main.run(words("suggest", *rivals, bag, "--duration", 2)) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "add the controller that ran" in err
    example = YAML(typ="safe").load(err.split("`")[1])
    check_controller(example["controller"])
    loops = []
    for rival in rivals:
        loops.append(tmp_path / rival.name)
        replace(load_model(rival), controller=LAW).save(loops[-1])
    assert main.run(words("suggest", *loops, bag, "--no-fit", "--duration", 2)) == 0
    assert " on the reference, 2 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        ([], "BAG"),
        (["BAG"], "MODEL"),
        (["MODEL", "nowhere"], "nowhere"),
        (["MODEL", "emps", "BAG", "--no-fit"], "different signals"),
        (["MODEL", "BAG", "--show", "dead_zon@input"], "dead_zone"),
        (["MODEL", "BAG", "--show", "dead_zone@input", "--max-velocity", "0"], "velocity"),
        (["MODEL", "emps", "BAG"], "different signals"),
        (["MODEL", "MODEL", "BAG", "--show", "dead_zone@input"], "takes one MODEL"),
        (["DEAD_ZONE", "BAG", "--show", "dead_zone@input"], "has this effect"),
        (["MODEL", "MODEL", "BAG", "--duration", "1e-4"], "a sample every 0.01 s"),
        (["MODEL", "BAG", "--duration", "1e12"], "50000000 samples"),
        (["MODEL", "BAG", "--start", "nan"], "start is nan"),
        (["MODEL", "CLOSED"], "add the controller"),
        (["BLIND", "CLOSED"], "reads motor.effort"),
        (["--ladder", "LADDER", "CLOSED"], "add the controller"),
        (["--ladder", "LADDER", "BAG", "--duration", "1e-4"], "a sample every 0.01 s"),
        (["--ladder", "LADDER", "--show", "dead_zone@input"], "leave --show out"),
        (["--ladder", "nowhere"], "ladder.json"),
        (["--ladder", "nowhere", "--between", "MODEL", "MODEL"], "--between"),
        (["MODEL", "BAG", "--output", "nowhere/a.yaml"], "nowhere"),
        (["MODEL", "BAG", "--plot", "a.txt"], ".svg"),
    ),
)
def test_wrong_use_is_one_line_before_any_work(arguments, word, hidden, rivals, refined, closed, monkeypatch, capsys):
    def begins(*arguments, **named):
        raise AssertionError("the work has begun")

    for work in (
        "idloop.estimation.fit",
        "idloop.diagnosis.diagnose",
        "idloop.diagnosis.design.next_experiment.suggest_next",
    ):
        monkeypatch.setattr(work, begins)
    places = {"MODEL": hidden.model, "BAG": hidden.two, "DEAD_ZONE": rivals[0], "CLOSED": closed, "LADDER": refined}
    places["BLIND"] = closed.parent / "blind.yaml"
    assert main.run(["suggest", *(str(places.get(a, a)) for a in arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert word in err
