"""`idloop import`: one line of summary, one document with --json, one line for every mistake."""

from __future__ import annotations

import json

import pytest

from idloop.cli import main

MAPPING = """\
schema: idloop/mapping/1
name: mine
joint: motor
time: {column: t, unit: ms}
command: {column: u, unit: V}
velocity: {column: w, unit: rad/s}
notes: [recorded by hand]
"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,w\n" + "".join(f"{k},{k % 3},{k}\n" for k in range(40)))
    (tmp_path / "my.yaml").write_text(MAPPING)
    return tmp_path


def _run(capsys, *words):
    code = main.run(["import", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def test_own_mapping(files, capsys):
    code, out, err = _run(capsys, "--map", files / "my.yaml", files / "a.csv", files / "bag")
    assert code == 0
    assert out.count("\n") == 1
    assert "40 samples, 0.039 s, every 1 ms" in out
    assert "joint_command motor.effort [V]" in out
    assert "recorded by hand" in err


def test_json(files, capsys):
    code, out, _ = _run(capsys, "--map", files / "my.yaml", files / "a.csv", files / "bag", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["schema"] == "idloop/import/1"
    assert document["samples"] == 40
    assert document["channels"] == {"joint_states motor.velocity": "rad/s", "joint_command motor.effort": "V"}


def test_list(capsys):
    code, out, _ = _run(capsys, "--list", "--json")
    assert code == 0
    assert next(item["parts"] for item in json.loads(out) if item["name"] == "ced") == ["z1", "z2", "z3"]
    assert "emps" in _run(capsys, "--list")[1]


def test_ready_set(data_dir, tmp_path, capsys):
    code, out, _ = _run(capsys, "ced", data_dir / "ced_prbs" / "drive.mat", tmp_path / "bag", "--part", "z2")
    assert code == 0
    assert "500 samples" in out


BAD = {
    "no words": ((), "give [SET] SRC BAG"),
    "no set": (("a.csv", "b"), "name a SET before the file"),
    "set and map": (("emps", "a.csv", "b", "--map", "my.yaml"), "not both"),
    "set misspelt": (("esmp", "a.csv", "b"), "did you mean 'emps'"),
    "file missing": (("--map", "my.yaml", "aa.csv", "b"), "did you mean 'a.csv'"),
    "bag exists": (("--map", "my.yaml", "a.csv", "my.yaml"), "not overwritten"),
    "part not there": (("--map", "my.yaml", "a.csv", "b", "--part", "z"), "leave --part"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes(files, capsys, monkeypatch, name):
    monkeypatch.chdir(files)
    words, line = BAD[name]
    code, out, err = _run(capsys, *words)
    assert (code, out) == (2, "")
    assert line in err
    assert err.count("\n") == 1
