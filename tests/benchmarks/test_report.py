"""The tables of a run count every case, by effect and by the view that decided."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from cases import clean
from realistic import realistic
from report import answers, by_effect_and_view


@pytest.fixture
def results(tmp_path):
    """One realistic case that was found, one where something else was named instead, and a clean one."""
    found, missed = list(realistic(lambda case_id: case_id.startswith("realistic/dead_zone/")))[:2]
    quiet = next(clean())
    path = tmp_path / "results.jsonl"
    with path.open("w", encoding="utf-8") as file:
        for case, names, view in ((found, ["dead_zone@input"], "force"), (missed, ["gravity@x"], "prediction"),
                                  (quiet, [], "prediction")):  # fmt: skip
            row = {"id": case.id, "level": 0.01, "seed": 1, "criterion": view, "seconds": 1.0, "verdict": "adequate",
                   "untestable": [], "worth": dict.fromkeys(case.truth, 0.5)}  # fmt: skip
            row["added"] = [{"name": n, "set": [n], "replaces": None, "p_value": 0.0, "gain": 9.0} for n in names]
            file.write(json.dumps(row) + "\n")
    return path


def rows_of(table, category):
    """Lines of one category by their title: the counts of each column."""
    part = next(block for block in table.split("\n\n") if block.strip().startswith(f"{category}:"))
    found = {}
    for line in part.strip().splitlines()[1:]:
        # an effect stands once for all views and then under each
        found.setdefault(line[:44].strip(), [word for word in line[44:].split() if "/" in word])
    return found


def test_every_category_is_told_by_effect_and_by_view(results, capsys):
    every, failed = answers(results)
    assert not failed
    by_effect_and_view(every)
    table = capsys.readouterr().out
    realistic, clean = rows_of(table, "realistic"), rows_of(table, "clean")
    assert set(realistic) == {"dead_zone", "view force", "view prediction"}
    assert realistic["dead_zone"][0] == "1/2"
    assert realistic["view force"][0] == "1/1"
    assert realistic["view prediction"][0] == "0/1"
    assert clean["none"][0] == "1/1"


def test_a_realistic_case_is_testable_by_what_its_effects_are_worth(results):
    every, _ = answers(results)
    assert all(a.testable for a in every if a.case.nuisances)
    text = results.read_text(encoding="utf-8").replace("0.5}", "0.05}")
    results.write_text(text, encoding="utf-8")
    every, _ = answers(results)
    assert not any(a.testable for a in every if a.case.nuisances)


@pytest.mark.parametrize("script", ["diagnosis/report.py", "diagnosis/check.py", "diagnosis_time.py"])
def test_a_script_runs_as_its_help_says(script):
    """Nothing but the script's own path leads to the modules that it imports."""
    path = Path(__file__).resolve().parents[2] / "benchmarks" / script
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, str(path), "--help"], check=False, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
