"""`idloop model`: what it prints can be read again; what is wrong with a file is said in one line."""

from __future__ import annotations

import json

import pytest

from idloop.cli import main
from idloop.physics import load_model, preset_names
from idloop.physics.model_file import PRESETS

GOOD = """\
schema: idloop/model/1
name: good
input:   {topic: joint_command, joint: motor, field: effort, unit: V}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad}
bodies:
  - {name: motor, inertia: 1.0, viscous_friction: {value: 2.0, min: 0.0}}
  - {name: load, inertia: 0.5}
couplings:
  - {from: motor, to: load, stiffness: {value: 10.0}, damping: 0.1}
drive: {gain: {value: 8.0}}
effects:
  - {effect: dead_zone, at: input, width: {value: 0.12}}
controller: null
"""

# What the user wrote instead, and the words that lead to the mistake and to its cure.
BAD = {
    "unit misspelt": ("unit: rad}", "unit: rda}", ("outputs[0]", "rda", "rad")),
    "unit of another quantity": ("unit: rad}", "unit: rad/s}", ("outputs[0]", "rad/s")),
    "input unit misspelt": ("unit: V", "unit: Vlot", ("input", "Vlot")),
    "effect misspelt": ("dead_zone", "dead_zoen", ("effects[0]", "dead_zoen", "dead_zone")),
    "effect parameter misspelt": ("width:", "widht:", ("effects[0]", "widht", "width")),
    "effect at a wrong site": ("at: input", "at: motor", ("effects[0]", "dead_zone", "input")),
    "effect at an unknown site": ("at: input", "at: inptu", ("effects[0]", "inptu", "input")),
    "negative inertia": ("inertia: 1.0", "inertia: -1.0", ("inertia", "> 0", "-1")),
    "no inertia": ("inertia: 0.5", "inertia: 0", ("load", "inertia", "> 0")),
    "negative friction": ("value: 2.0, min: 0.0", "value: -2.0", ("viscous_friction", "-2")),
    "infinite inertia": ("inertia: 1.0", "inertia: .inf", ("inertia", "inf")),
    "value that is no number": ("inertia: 1.0", "inertia: heavy", ("inertia", "number")),
    "value below its minimum": ("value: 2.0, min: 0.0", "value: 2.0, min: 3.0", ("viscous_friction", "below min")),
    "unknown key": ("drive:", "driv:", ("driv", "drive")),
    "needed key misspelt": ("inertia: 1.0", "inertai: 1.0", ("inertai", "did you mean 'inertia'")),
    "unknown key of a body": ("viscous_friction:", "viscous_fricton:", ("viscous_fricton", "viscous_friction")),
    "unknown key of a value": ("value: 2.0, min", "value: 2.0, mim", ("mim", "min")),
    "unknown field": ("field: position", "field: angle", ("outputs", "field", "position")),
    "joint that is no body": ("joint: motor, field: position", "joint: moto, field: position", ("moto", "motor")),
    "nothing measured": ("  - {topic: joint_states, joint: motor, field: position, unit: rad}", "  []", ("outputs",)),
    "bodies not joined": (
        "  - {from: motor, to: load, stiffness: {value: 10.0}, damping: 0.1}",
        "  []",
        ("couplings",),
    ),
    "coupling of strangers": ("to: load", "to: laod", ("laod",)),
    "another schema": ("idloop/model/1", "idloop/model/9", ("schema", "idloop/model/1")),
    "no YAML": ("bodies:", "bodies: [", ("line",)),
    "a list": (GOOD, "- 1\n- 2\n", ("mapping",)),
    "empty": (GOOD, "", ()),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_model_file_is_one_line_and_exit_code_2(name, tmp_path, capsys):
    right, wrong, words = BAD[name]
    assert right in GOOD
    path = tmp_path / "bad.yaml"
    path.write_text(GOOD.replace(right, wrong, 1), encoding="utf-8")
    assert main.run(["model", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert err.startswith("idloop model: ")
    for word in ("bad.yaml", *words):
        assert word in err


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        (["dc_moter"], "dc_motor"),
        (["."], "."),
        (["dc_motor", "--set", "motor.inerta=2"], "motor.inertia"),
        (["dc_motor", "--set", "motor.inertia=-2"], "outside"),
        (["dc_motor", "--effect", "dead_zone"], "give the site as well: dead_zone@input"),
        (["dc_motor", "--effect", "dead_zone@input(width=wide)"], "width = wide is no number"),
        (["dc_motor", "--effect", "dead_zoen@input"], "dead_zone"),
        (["dc_motor", "--effect", "dead_zone@input(widht=1)"], "width"),
    ),
)
def test_bad_arguments_are_one_line_and_exit_code_2(arguments, word, capsys):
    assert main.run(["model", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert word in err


def test_a_file_is_printed_whole_and_reads_back_equal(tmp_path, capsys):
    path, printed = tmp_path / "good.yaml", tmp_path / "printed.yaml"
    path.write_text(GOOD, encoding="utf-8")
    assert main.run(["model", str(path)]) == 0
    printed.write_text(capsys.readouterr().out, encoding="utf-8")
    assert load_model(printed) == load_model(path)


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_is_printed_with_its_comments(name, capsys):
    assert main.run(["model", name]) == 0
    assert capsys.readouterr().out == (PRESETS / f"{name}.yaml").read_text(encoding="utf-8")


def test_options_change_the_model(capsys):
    arguments = ["model", "dc_motor", "--set", "motor.inertia=2", "--effect", "dead_zone@input(width=0.1)", "--json"]
    assert main.run(arguments) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["bodies"][0]["inertia"] == 2.0
    assert document["effects"][0]["effect"] == "dead_zone"


def test_the_list_names_every_preset(capsys):
    assert main.run(["model", "--list"]) == 0
    text = capsys.readouterr().out
    assert main.run(["model", "--list", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in document] == list(preset_names())
    assert all(name in text for name in preset_names())
