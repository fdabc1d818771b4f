"""`idloop compensate`: what it says, writes and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from idloop.api import tracking_runs
from idloop.cli import main
from idloop.physics import load_model
from idloop.records import record_from_model, write_bag

FRICTION = "coulomb_friction@axis(level=0.15)"
DEAD = "dead_zone@input(width=0.3)"
SHORT = "{name: smooth, points: [1.0, -1.0], amplitude: 0.5, velocity_limit: 0.5, duration: 4.0}"
LAW = (
    "{type: pd, output: axis.position, kp: 4.0, kd: 0.3, velocity_feedforward: 0.3, derivative_filter: 0.005, "
    "limit: 10.0, sample_time: 0.002}"
)
BASE = ["compensate", "axis", "--reference", SHORT, "--controller", LAW]


def run(capsys, *words):
    assert main.run([*BASE, *words, "--json"]) == 0
    out, err = capsys.readouterr()
    return json.loads(out), err


def test_the_error_falls_to_that_of_the_linear_loop(capsys):
    found, err = run(capsys, "--effect", FRICTION, "--effect", DEAD)
    assert err == ""
    assert found["schema"] == "idloop/compensate/1"
    assert found["cancelled"] == {"dead_zone@input": "inverse", "coulomb_friction@axis": "force"}
    error = found["errors"]["axis.position"]
    assert list(found["errors"]) == ["axis.position"]
    assert error["ratio"] == error["with"]["rms"] / error["without"]["rms"] <= 0.5
    assert error["with"]["rms"] - error["aim"]["rms"] <= 0.05 * error["without"]["rms"]
    assert found["settings"]["limit"] == 5.0
    assert found["reference"]["signal"]["amplitude"] == 0.5


def test_the_machine_may_be_another_than_the_model_says(capsys):
    effects = ["--effect", "coulomb_friction@axis(level=0.12)"]
    plant = ["--plant", "axis", "--plant-effect", FRICTION, "--plant-effect", "input_offset@input(offset=0.01)"]
    guessed, _ = run(capsys, *effects, *plant)
    known, _ = run(capsys, "--effect", FRICTION, *plant)
    before, after, best = (
        guessed["errors"]["axis.position"]["without"]["rms"],
        guessed["errors"]["axis.position"]["with"]["rms"],
        known["errors"]["axis.position"]["with"]["rms"],
    )
    assert best < after < before
    assert known["errors"]["axis.position"]["without"]["rms"] == before


def test_a_table_for_the_eye_with_reasons(capsys):
    words = ["--effect", FRICTION, "--effect", "input_delay@input(delay=0.001)", "--only", "coulomb_friction"]
    assert main.run([*BASE, *words]) == 0
    out, _ = capsys.readouterr()
    assert "not cancelled: its inverse would have to act before the command is known" in out
    assert "reference: smooth (" in out
    assert "rms without the effects" in out
    assert "axis.position" in out


def test_an_axis_that_does_not_move_is_said(capsys):
    assert main.run([*BASE, "--effect", "coulomb_friction@axis(level=60.0)", "--only", "coulomb_friction"]) == 0
    said = capsys.readouterr().out
    assert "warning: without compensation the axis does not move" in said
    assert "warning: with compensation the axis does not move" in said
    assert main.run([*BASE, "--effect", FRICTION]) == 0
    assert "warning" not in capsys.readouterr().out


def test_a_model_without_effects_gains_nothing_and_loses_nothing(capsys):
    found, _ = run(capsys)
    assert found["cancelled"] == {}
    assert found["errors"]["axis.position"]["ratio"] == 1.0
    assert main.run(BASE) == 0
    assert "has no effects" in capsys.readouterr().out


def test_a_controller_may_lie_in_a_file(tmp_path, capsys):
    file = tmp_path / "law.yaml"
    file.write_text(LAW, encoding="utf-8")
    answers = []
    for law in (LAW, str(file)):
        given = ["compensate", "axis", "--reference", SHORT, "--controller", law, "--no-noise", "--json"]
        assert main.run(given) == 0
        answers.append(json.loads(capsys.readouterr().out)["errors"])
    assert answers[0] == answers[1]


def test_the_default_reference_stays_within_half_of_the_limit(capsys):
    law = LAW.replace("limit: 10.0", "limit: 0.1")
    assert main.run(["compensate", "axis", "--controller", law, "--no-noise", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["command"]["without"]["largest"] == pytest.approx(0.05, rel=0.05)
    assert 0.0 < found["reference"]["signal"]["amplitude"] < 1.0


def test_files_for_the_controller_node_and_the_eye(tmp_path, capsys):
    plot, output = tmp_path / "gained.png", tmp_path / "compensator.yaml"
    words = [
        "--effect",
        FRICTION,
        "--effect",
        "saturation@input(limit=5.0)",
        "--plot",
        str(plot),
        "--output",
        str(output),
    ]
    found, err = run(capsys, *words)
    assert plot.stat().st_size > 10_000
    assert err == f"written: {output}\nwritten: {plot}\n"
    written = load_model(str(output))
    assert written.effect_names == ("coulomb_friction@axis",)
    assert written.controller == yaml.safe_load(LAW)
    assert "saturation@input: no command brings back" in output.read_text(encoding="utf-8")
    assert main.run(["compensate", str(output), "--reference", SHORT, "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["errors"]["axis.position"]["with"]["rms"] < found["errors"]["axis.position"]["without"]["rms"]
    assert main.run([*BASE, "--output", str(output)]) == 2
    assert "--force" in capsys.readouterr().err


def test_the_reference_of_a_recording(tmp_path, capsys):
    model = load_model("axis")
    time = np.arange(2000) * 0.002
    path = np.column_stack([0.3 * np.sin(2.0 * time), 0.6 * np.cos(2.0 * time)])
    record = record_from_model("recorded", model, time, np.sin(time), np.zeros((2000, 2)), path)
    bag = write_bag(tmp_path / "bag", record)
    assert main.run([*BASE[:2], "--controller", LAW, "--reference", str(bag), "--effect", FRICTION, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["reference"] == {"signal": None, "text": f"as recorded in {bag}"}
    assert found["errors"]["axis.position"]["ratio"] < 0.5


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["compensate", "axs"], "axis"),
        (["compensate", "axis", "--controller", "{type: none}"], "follows nothing"),
        (["compensate", "axis", "--controller", "{type: pidd}"], "pid"),
        (["compensate", "axis", "--controller", "[1"], "not valid YAML"),
        (["compensate", "axis", "--controller", "1.0"], "no mapping"),
        (["compensate", "axis", "--reference", "{amplitude: 1.0}"], "name is missing"),
        (["compensate", "axis", "--reference", "{name: sinus}"], "sine"),
        (["compensate", "axis", "--reference", "nowhere"], "no bag nowhere"),
        (["compensate", "axis", "--plant", "torsion"], "must be the same"),
        (["compensate", "axis", "--plant", "nowhere.xml"], "nowhere.xml"),
        (["compensate", "axis", "--plant", "x.xml", "--plant-effect", FRICTION], "effects of its own"),
        (["compensate", "axis", "--only", "cogging"], "no effect 'cogging'"),
        (["compensate", "axis", "--limit", "11"], "above the controller's limit"),
        (["compensate", "axis", "--limit", "0"], "--limit"),
        (["compensate", "axis", "--settle", "100"], "--settle"),
        (["compensate", "axis", "--bags", "x"], "--graph"),
        (["compensate", "axis", "--plot", "x.txt"], ".png"),
        (["compensate", "axis", "--effect", "input_delay@input(delay=0.1)", "--only", "input_delay"],
         "cannot be cancelled"),
        (["compensate", "emps", "--controller", "{type: p, output: axis.velocity, kp: 1.0, sample_time: 0.001}"],
         "no output"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_and_exit_code_2(words, said, capsys):
    code = main.run(words)
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    assert err.count("\n") == 1
    assert said in err


def test_a_bag_cannot_be_followed_on_the_graph(tmp_path, capsys, monkeypatch):
    recorded = tracking_runs.Reference(np.zeros((5000, 2)), None, "as recorded")
    monkeypatch.setattr(tracking_runs, "make_reference", lambda *_: recorded)
    assert main.run([*BASE, "--graph"]) == 2
    assert "must be a signal" in capsys.readouterr().err
