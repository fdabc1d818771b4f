"""What is to be run after a log was started, and which of several records is to judge."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.records.formats.corpus import FORMS

from idloop.api.next_commands import diagnosing, held_out, with_purpose
from idloop.cli import main

FITTED = Path("out/fitted.yaml")


def _inspection(name, *command, count=100):
    axis = SimpleNamespace(time=np.zeros(count), command=np.array(command))
    return SimpleNamespace(path=Path(name), axes=(axis,))


@pytest.mark.parametrize(
    ("inspections", "found"),
    [
        ([_inspection("a", -1, 1)], None),
        ([_inspection("a", -1, 1), _inspection("b", -1, 0.9)], "a"),
        ([_inspection("a", -1, 1), _inspection("b", -1, 0.9, count=50)], "b"),
        ([_inspection("a", -1, 1), _inspection("b", -2, 2, count=50)], "a"),
        ([_inspection("a", -1, 1), _inspection("b", 0, 9, count=50)], None),
        ([_inspection("a", 1), _inspection("b", 2)], None),
        ([_inspection("a", 1), _inspection("b", 2), _inspection("c", 3)], "b"),
        ([_inspection("a", -1, 1), _inspection("b")], None),
    ],
    ids=["one", "equal", "shorter", "shorter and beyond", "none within", "levels", "a level between", "no command"],
)
def test_the_shortest_record_within_the_others_judges(inspections, found):
    assert held_out(inspections) == (None if found is None else Path(found))


def test_the_record_that_judges_is_not_fitted():
    a, b, out = Path("a"), Path("b"), Path("out/refined")
    assert diagnosing(FITTED, [a, b], b, out) == [
        "idloop diagnose out/fitted.yaml a b",
        "idloop refine out/fitted.yaml a --validate b --output out/refined",
        "idloop workbench out/fitted.yaml a --validate b",
    ]
    assert diagnosing(FITTED, [a], None, out)[1:] == [
        "idloop refine out/fitted.yaml a --output out/refined",
        "idloop workbench out/fitted.yaml a",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["units_in_brackets", "two_runs_in_two_files"])
def test_two_commands_lead_from_a_log_to_a_named_effect(name, tmp_path, capsys):
    log = FORMS[name](tmp_path)
    folder = str(tmp_path / "begun")
    assert main.run(["start", *map(str, log.files), *log.flags, "--output", folder, "--json", "--quiet"]) == 0
    following = [shlex.split(line)[1:] for line in json.loads(capsys.readouterr().out)["next"]]
    assert [words[0] for words in following] == ["diagnose", "refine", "workbench"]
    assert ("--validate" in following[1]) == (log.records > 1)
    assert main.run([*following[1], "--json", "--quiet"]) == 0
    ladder = json.loads(capsys.readouterr().out)["ladder"]
    assert ladder[1]["added"]["effect"] == "coulomb_friction"


def test_each_command_says_what_it_is_for_and_can_be_copied_with_it():
    lines = list(with_purpose(diagnosing(FITTED, [Path("bags/a")], None, Path("out/refined"))))
    assert [line for line in lines if not line.startswith("  #")] == [
        "  idloop diagnose out/fitted.yaml bags/a",
        "  idloop refine out/fitted.yaml bags/a --output out/refined",
        "  idloop workbench out/fitted.yaml bags/a",
    ]
    assert lines[0] == "  # does the model lack a physical effect, and which one?"
    fits = list(with_purpose(["idloop fit m.yaml a", "idloop fit m.yaml b"]))
    assert fits == ["  # fit the model to these records", "  idloop fit m.yaml a", "  idloop fit m.yaml b"]


def test_many_records_are_written_as_one_word_that_the_shell_expands():
    bags = [Path(f"out dir/bags/log_run{k}") for k in range(1, 83)]
    lines = list(with_purpose(diagnosing(FITTED, bags, bags[44], Path("out/refined"))))
    numbers = "{{1..44},{46..82}}"
    assert lines[1] == "  idloop diagnose out/fitted.yaml 'out dir/bags/log_run'{1..82}"
    assert lines[3].startswith(f"  idloop refine out/fitted.yaml 'out dir/bags/log_run'{numbers} --validate 'out dir/")
    shell = shutil.which("bash")
    if shell:
        words = subprocess.run([shell, "-c", f"printf '%s\\n' {lines[3]}"], capture_output=True, text=True, check=True)
        fitted = [str(bag) for bag in bags if bag != bags[44]]
        assert words.stdout.splitlines()[3:-4] == fitted
    named = list(with_purpose(diagnosing(FITTED, [Path(f"bags/{name}") for name in "abcdefgh"], None, Path("out"))))
    assert named[1] == "  idloop diagnose out/fitted.yaml " + " ".join(f"bags/{name}" for name in "abcdefgh")
