"""The Python files beside a model run once their user has said so, as they were then, and never before."""

from __future__ import annotations

import os
import pickle
import py_compile
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from idloop.diagnosis import Ladder
from idloop.diagnosis.ladder import Step
from idloop.errors import InputError
from idloop.physics import load_model, simulate, trust
from idloop.physics.model_file import from_text
from idloop.reporting.ladder_folder import Kept, read_ladder, write_ladder

LEAN = """\
from pathlib import Path

from idloop.physics import Effect, EffectParameter, hook

with Path({log!r}).open("a") as log:
    log.write({said!r})


@hook
def force(position, velocity, inertia, elapsed, state, parameters):
    return parameters[0]


EFFECT = Effect("lean", "body", "It leans.", (EffectParameter("size", "{{force}}"),), force=force)
"""


class Project:
    """A model file with an effect beside it that writes down whenever it is run."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.log = folder, folder / "log.txt"
        self.model, self.effects = folder / "model.yaml", folder / "effects"
        self.effects.mkdir(parents=True)
        self.write("lean.py")
        self.model.write_text(load_model("axis").to_yaml())

    def write(self, name: str, said: str = "run;") -> Path:
        path = self.effects / name
        path.write_text(LEAN.format(log=str(self.log), said=said))
        return path

    @property
    def said(self) -> str:
        return self.log.read_text() if self.log.exists() else ""

    def trust(self) -> None:
        trust.trust(trust.read_effect_files(self.effects))


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(trust, "_ALLOWED", set())
    return tmp_path / "state" / "idloop"


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path / "project")


def refused(project: Project, why: str = "which are not trusted") -> None:
    before = project.said
    with pytest.raises(InputError) as caught:
        load_model(project.model)
    line = str(caught.value)
    assert why in line
    assert line.endswith(f"idloop trust {project.effects}")
    assert "\n" not in line
    assert project.said == before


def test_nothing_runs_before_it_is_trusted(project: Project) -> None:
    refused(project)
    project.trust()
    assert load_model(project.model).with_effects(["lean@axis(size=0.1)"]).effect_names == ("lean@axis",)
    assert project.said == "run;"


CHANGES = {
    "another content": lambda project: project.write("lean.py", "other;"),
    "one file more": lambda project: project.write("more.py"),
    "a helper more": lambda project: project.write("_helper.py"),
    "another name": lambda project: (project.effects / "lean.py").rename(project.effects / "bend.py"),
    "one file less": lambda project: (project.effects / "_other.py").unlink(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_was_changed_asks_again(project: Project, change: str) -> None:
    project.write("_other.py")
    project.trust()
    load_model(project.model)
    CHANGES[change](project)
    refused(project, "which have changed since they were trusted")
    project.trust()
    load_model(project.model)


def test_what_was_changed_while_a_model_is_open_does_not_run(project: Project) -> None:
    project.trust()
    model = load_model(project.model)
    project.write("lean.py", "other;")
    # As the page, a message or a parameter of a running node would ask for it.
    with pytest.raises(InputError, match="have changed since"):
        model.with_effects(["lean@axis(size=0.1)"])
    with pytest.raises(InputError, match="have changed since"):
        from_text(
            model.to_yaml().replace("effects: []", "effects: [{effect: lean, at: axis, size: 1.0}]"), model.folder
        )
    assert project.said == "run;"


def test_what_is_read_is_what_runs(project: Project) -> None:
    files = trust.read_effect_files(project.effects)
    trust.trust(files)
    project.write("lean.py", "other;")
    assert trust.kept_copy(files, "lean.py").read_bytes() == files.sources["lean.py"]


def test_equal_files_of_two_folders_share_no_machine_code(project: Project, tmp_path: Path) -> None:
    shutil.copytree(project.folder, tmp_path / "copy")
    here, there = (trust.read_effect_files(folder / "effects") for folder in (project.folder, tmp_path / "copy"))
    assert here.checksum == there.checksum
    assert trust.kept_copy(here, "lean.py") != trust.kept_copy(there, "lean.py")


def test_helpers_alone_ask_nothing(project: Project) -> None:
    (project.effects / "lean.py").rename(project.effects / "_lean.py")
    load_model(project.model)
    assert project.said == ""


def test_the_same_files_elsewhere_ask_again(project: Project, tmp_path: Path) -> None:
    project.trust()
    load_model(project.model)
    shutil.copytree(project.folder, tmp_path / "copy")
    with pytest.raises(InputError, match="not trusted"):
        load_model(tmp_path / "copy" / "model.yaml")


def test_a_link_is_the_folder_that_it_leads_to(project: Project, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(project.folder)
    project.trust()
    load_model(tmp_path / "link" / "model.yaml")
    assert project.said == "run;"


def test_what_is_trusted_is_listed_and_can_be_revoked(project: Project, tmp_path: Path) -> None:
    other = Project(tmp_path / "other")
    for one in (project, other):
        one.trust()
    load_model(project.model)
    assert [(one.folder, one.state) for one in trust.trusted_folders()] == [
        (other.effects, "trusted"),
        (project.effects, "trusted"),
    ]
    other.write("lean.py", "other;")
    assert [one.state for one in trust.trusted_folders()] == ["changed", "trusted"]
    shutil.rmtree(other.effects)
    assert [one.state for one in trust.trusted_folders()] == ["gone", "trusted"]
    trust.revoke(other.effects)
    trust.revoke(project.effects)
    assert trust.trusted_folders() == []
    refused(project)
    with pytest.raises(InputError, match="is not trusted"):
        trust.revoke(project.effects)


def test_a_caller_may_allow_what_nobody_has_trusted(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    model = load_model(project.model, allow_effects=True).with_effects(["lean@axis(size=0.1)"])
    assert trust.trusted_folders() == []
    text = pickle.dumps(model)
    # Another process knows of it when the model is sent there, and of no other one.
    monkeypatch.setattr(trust, "_ALLOWED", set())
    refused(project)
    assert pickle.loads(text).effect_names == ("lean@axis",)
    project.write("lean.py", "other;")
    refused(project)


def test_compiled_code_beside_the_files_never_runs(project: Project, tmp_path: Path) -> None:
    path = project.write("lean.py", "seen")
    text, times = path.read_text(), path.stat()
    # Of the same size and time as what its user looks at, which is all that Python compares.
    path.write_text(text.replace("seen", "evil"))
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    py_compile.compile(str(path))
    path.write_text(text)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    plain = subprocess.run([sys.executable, "-c", "import lean"], cwd=project.effects, check=True)
    assert (plain.returncode, project.said) == (0, "evil")
    project.trust()
    load_model(project.model)
    assert project.said == "evilseen"


def test_machine_code_is_cached_where_nobody_else_can_write(project: Project, state: Path) -> None:
    project.trust()
    machine = load_model(project.model).with_effects(["lean@axis(size=1.0)"])
    moved = simulate(machine, [0.0], [0.0], np.array([0.0, 0.1])).output
    assert moved[-1, 0] > 0.0
    assert not (project.effects / "__pycache__").exists()
    assert list(state.glob("effects/*/__pycache__/*.nbi"))
    for path in [state, *state.rglob("*")]:
        mode = stat.S_IMODE(path.stat().st_mode)
        assert path.parent.name == "__pycache__" or path.name == "__pycache__" or not mode & 0o077


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_state_folder_that_others_can_write_into_is_refused(project: Project, state: Path, mode: int) -> None:
    project.trust()
    state.chmod(mode)
    with pytest.raises(InputError, match="others can write into this folder"):
        load_model(project.model)
    assert project.said == ""


def test_a_state_folder_that_cannot_be_written_is_one_line(project: Project, state: Path) -> None:
    state.parent.write_text("a file")
    with pytest.raises(InputError, match=r"cannot be written .*set XDG_STATE_HOME") as caught:
        project.trust()
    assert "\n" not in str(caught.value)


def test_an_effect_reads_data_that_lie_beside_it(project: Project) -> None:
    path = project.write("lean.py")
    path.write_text(path.read_text().replace("'run;'", '(Path(__file__).parent / "table.txt").read_text()'))
    (project.effects / "table.txt").write_text("of a table;")
    project.trust()
    load_model(project.model)
    assert project.said == "of a table;"


def test_a_ladder_that_names_the_folder_does_not_run_it_either(project: Project, tmp_path: Path) -> None:
    errors = {"nrmse": {"axis.position": 0.1}, "fit": {"axis.position": 90.0}, "force": None}
    project.trust()
    model = load_model(project.model).with_effects(["lean@axis(size=0.1)"])
    ladder = Ladder((Step(None, model, train=errors, validation=errors),), criterion="prediction", level=0.01)
    write_ladder(tmp_path / "ladder", Kept(ladder, folder=project.folder))
    trust.revoke(project.effects)
    before = project.said
    with pytest.raises(InputError, match="not trusted"):
        read_ladder(tmp_path / "ladder")
    assert project.said == before


def test_a_folder_of_other_files_is_not_read_whole(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trust, "_MOST_FILES", 3)
    for k in range(3):
        project.write(f"lean{k}.py")
    with pytest.raises(InputError, match="no folder of effects"):
        load_model(project.model)
