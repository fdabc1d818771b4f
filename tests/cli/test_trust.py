"""`idloop trust` on the command line: one word for each folder, and what there is can be seen and taken back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from idloop.cli import main
from idloop.physics import load_model

EFFECT = """\
from idloop.physics import Effect, ParameterSpec, hook


@hook
def force(position, velocity, inertia, elapsed, state, parameters):
    return parameters[0]


EFFECT = Effect("lean", "body", "It leans.", (ParameterSpec("size", "{force}"),), force=force)
"""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / "my project"
    (folder / "effects").mkdir(parents=True)
    (folder / "effects" / "lean.py").write_text(EFFECT)
    (folder / "model.yaml").write_text(
        load_model("axis").to_yaml().replace("effects: []", "effects: [{effect: lean, at: axis, size: 0.5}]")
    )
    return folder


@pytest.mark.parametrize("place", ["model.yaml", ".", "effects"])
def test_the_line_says_how_and_then_the_model_opens(project, place, capsys):
    assert main.run(["model", str(project / "model.yaml")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.endswith(f"(lean.py), which are not trusted; look at them, then run: idloop trust '{project}/effects'\n")
    assert main.run(["trust", str(project / place)]) == 0
    assert capsys.readouterr().out == f"{project}/effects: lean.py may run; whatever changes asks again\n"
    assert main.run(["model", str(project / "model.yaml")]) == 0
    assert "effect: lean" in capsys.readouterr().out


def test_what_is_trusted_is_listed_and_revoked(project, capsys):
    assert main.run(["trust", "--list"]) == 0
    assert capsys.readouterr().out == "no folder is trusted\n"
    assert main.run(["trust", str(project), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == ["lean.py"]
    assert main.run(["trust", "--list"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].split("  ") == [f"{project}/effects", "trusted"]
    assert main.run(["trust", "--list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["folders"] == [{"folder": f"{project}/effects", "state": "trusted"}]
    assert main.run(["trust", "--revoke", str(project / "model.yaml")]) == 0
    assert capsys.readouterr().out == f"{project}/effects: not trusted any more\n"
    assert main.run(["model", str(project / "model.yaml")]) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "name one folder or model file"),
        (["--list", "PLACE"], "name one folder or model file"),
        (["--list", "--revoke"], "name one folder or model file"),
        (["nowhere"], "no folder with Python files"),
        (["--revoke", "PLACE"], "is not trusted"),
    ],
)
def test_wrong_use_of_trust_is_one_line(project, arguments, said, capsys):
    assert main.run(["trust", *(str(project) if word == "PLACE" else word for word in arguments)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
