"""`idloop export`: files and stdout, what is lost on stderr, and one line for what is wrong."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from idloop.cli import main
from idloop.exporters import FORMATS
from idloop.physics import load_model


def test_one_format_goes_to_stdout_and_its_losses_to_stderr(capsys):
    assert main.run(["export", "axis", "--format", "urdf", "--effect", "cogging@axis(amplitude=0.1)"]) == 0
    out, err = capsys.readouterr()
    assert ET.fromstring(out).tag == "joint"
    assert all(line.startswith("urdf: not carried: ") for line in err.splitlines())
    assert "cogging@axis" in err


def test_all_formats_go_to_a_folder(tmp_path, capsys):
    folder = tmp_path / "new"
    assert main.run(["export", "torsion", "--output", str(folder)]) == 0
    assert len(list(folder.iterdir())) == len(FORMATS) - 1  # a C header is of one body
    assert capsys.readouterr().out == ""
    assert main.run(["export", "torsion", "--output", str(folder)]) == 2
    assert "--force" in capsys.readouterr().err
    assert main.run(["export", "torsion", "--output", str(folder), "--force"]) == 0


def test_a_strange_name_of_a_model_stays_inside_the_folder(tmp_path):
    path, folder = tmp_path / "strange.yaml", tmp_path / "out"
    path.write_text(
        load_model("axis").to_yaml().replace("name: axis\ndesc", "name: ../up.and away\ndesc"), encoding="utf-8"
    )
    assert main.run(["export", str(path), "--output", str(folder)]) == 0
    assert {file.name.split(".")[0] for file in folder.iterdir()} == {"up_and_away"}
    assert {entry.name for entry in tmp_path.iterdir()} == {"strange.yaml", "out"}


def test_one_format_goes_to_the_file_that_is_named(tmp_path):
    path = tmp_path / "axis.xml"
    assert main.run(["export", "axis", "--format", "mujoco", "--output", str(path)]) == 0
    assert ET.parse(path).getroot().tag == "mujoco"


def test_json_is_one_document_with_every_file(capsys):
    assert main.run(["export", "dc_motor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "idloop/export/1"
    assert [file["format"] for file in document["files"]] == list(FORMATS)
    assert all(file["text"] and file["path"] is None for file in document["files"])


def test_a_model_that_is_no_joint_is_left_out_of_the_formats_of_joints(tmp_path, capsys):
    text = load_model("axis").to_yaml().replace("rad/s", "V/s").replace("unit: rad", "unit: V")
    path = tmp_path / "circuit.yaml"
    path.write_text(text, encoding="utf-8")
    assert main.run(["export", str(path), "--json"]) == 0
    out, err = capsys.readouterr()
    assert [file["format"] for file in json.loads(out)["files"]] == [
        "control",
        "ros2_control",
        "compensator",
        "c",
        "json",
    ]
    assert "urdf: left out" in err
    assert main.run(["export", str(path), "--format", "urdf"]) == 2


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        (["dc_moter", "--format", "urdf"], "dc_motor"),
        (["axis", "--format", "udrf"], "urdf"),
        (["axis"], "--output"),
        (["axis", "--format", "urdf", "--output", "no/such/folder/x.xml"], "no/such/folder"),
        (["axis", "--format", "urdf", "--output", "."], "folder"),
        (["axis", "--format", "urdf", "--set", "axis.inertai=1"], "axis.inertia"),
        ([], "MODEL"),
    ),
)
def test_what_is_wrong_is_one_line_and_exit_code_2(arguments, word, capsys):
    assert main.run(["export", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert word in err


def test_the_page_shows_what_the_command_prints(capsys):
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
    shown = re.findall(
        r"```sh\n\.venv/bin/idloop (export [^\n]*--format[^\n]*)\n```\n\n```\w+\n(.*?)```", page, re.DOTALL
    )
    assert [re.search(r"--format (\w+)", line)[1] for line, _ in shown] == list(FORMATS)
    for line, text in shown:
        assert main.run(shlex.split(line)) == 0
        assert capsys.readouterr().out == text
