"""`idloop robot`: bad input is one line."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.cli import main
from idloop.records import make_stream, write_bag

URDF = """<robot name="one"><link name="base"/><joint name="hinge" type="revolute"><parent link="base"/>
<child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<link name="arm"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
</link></robot>"""


@pytest.fixture
def files(tmp_path):
    pytest.importorskip("pinocchio")
    (tmp_path / "one.urdf").write_text(URDF)
    time = np.arange(300) * 0.01
    columns = {"wheel": {"position": np.sin(time), "effort": np.cos(time)}}
    write_bag(tmp_path / "other", [make_stream("joint_states", (time * 1e9).astype(np.int64) + 10**15, columns)])
    return tmp_path


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("none.urdf", "other"), "cannot be read as a URDF"),
        (("one.urdf", "none"), "no bag"),
        (("one.urdf", "other"), "none of the robot's joints is in it"),
        (("one.urdf", "other", "--topic", "states"), "no topic 'states'"),
        (("one.urdf", "other", "--level", "2"), "level"),
    ],
)
def test_bad_input_is_one_line(files, monkeypatch, capsys, words, line):
    monkeypatch.chdir(files)
    assert main.run(["robot", *words]) == 2
    said = capsys.readouterr().err
    assert line in said
    assert said.count("\n") == 1


def test_a_missing_extra_is_one_line(files, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "pinocchio", None)
    assert main.run(["robot", str(files / "one.urdf"), str(files / "other")]) == 2
    assert "pip install 'idloop[robot]'" in capsys.readouterr().err


def test_a_trajectory_is_planned_and_written(files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    words = ("excite", "one.urdf", "--period", "4", "--harmonics", "2", "--steps", "2", "--output", "t.csv")
    assert main.run(["robot", *words]) == 0
    assert "condition number" in capsys.readouterr().out
    assert (files / "t.csv").read_text().startswith("time,hinge.position")
    assert main.run(["robot", *words]) == 2
    assert "the file is there already" in capsys.readouterr().err
