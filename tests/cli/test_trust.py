"""`idloop trust` on the command line: one word for each folder, and what there is can be seen and taken back."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from idloop.cli import main
from idloop.physics import load_model, trust

EFFECT = """\
from pathlib import Path

from idloop.physics import Effect, EffectParameter, hook

with Path(__file__).with_suffix(".log").open("a") as log:
    log.write("run")


@hook
def force(position, velocity, inertia, elapsed, state, parameters):
    return parameters[0]


EFFECT = Effect("lean", "body", "It leans.", (EffectParameter("size", "{force}"),), force=force)
"""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(trust, "_ALLOWED", set())
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


# Each ends right after its model is open: at a parameter or a bag that is none.
VERBS = (
    "model MODEL --set nonsense=1",
    "fit MODEL BAG --set nonsense=1",
    "compare MODEL BAG --set nonsense=1",
    "compare axis MODEL BAG",
    "diagnose MODEL BAG --set nonsense=1",
    "refine MODEL BAG --set nonsense=1",
    "workbench MODEL BAG --set nonsense=1",
    "monitor MODEL BAG --effect lean@axis --set nonsense=1",
    "export MODEL --set nonsense=1",
    "compensate MODEL --set nonsense=1",
    "compensate axis --plant MODEL --plant-effect nonsense",
    "identify BAG --model MODEL",
    "suggest axis MODEL BAG",
    "suggest --between axis MODEL BAG",
)


@pytest.mark.parametrize("line", VERBS)
def test_every_verb_can_be_told_to_run_them_once(project, line, capsys, monkeypatch):
    places = {"MODEL": str(project / "model.yaml"), "BAG": str(project)}
    words, log = [places.get(word, word) for word in line.split()], project / "effects" / "lean.log"
    assert main.run(words) == 2
    assert "idloop trust" in capsys.readouterr().err
    assert not log.exists()
    # Also where it stands behind the model.
    assert main.run([*words, "--trust-effects"]) == 2
    assert "idloop trust" not in capsys.readouterr().err
    assert log.read_text() == "run"
    # The next command asks again, and nothing is remembered.
    monkeypatch.setattr(trust, "_ALLOWED", set())
    assert main.run(words) == 2
    assert "idloop trust" in capsys.readouterr().err
    assert trust.trusted_folders() == []


def test_a_recording_with_effects_in_its_folder_runs_none_of_them(project, hidden, capsys):
    bag = shutil.copytree(hidden.two, project / "bag")
    shutil.copytree(project / "effects", bag / "effects")
    for words in (["inspect", bag], ["compare", hidden.model, bag, "--trust-effects"]):
        assert main.run([str(word) for word in words]) == 0
    assert not list(project.rglob("lean.log"))
    capsys.readouterr()
