"""`idloop fleet`: bad input is one line; its work is tested in tests/api and tests/fleet."""

from __future__ import annotations

import subprocess
import sys

import pytest

from idloop.cli import main
from idloop.fleet.libraries import NEEDED

pytest.importorskip("distributed")
pytest.importorskip("duckdb")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("none.csv",), "there is no such table"),
        ((".",), "there is no bag"),
        ((".", "--since", "soon"), "'soon' is no date"),
        ((".", "--memory", "much"), "--memory much"),
        ((".", "--diagnose", "some"), "--diagnose some"),
        ((".", "--level", "0"), "level is 0"),
        ((".", "--model", "axis"), "there is a model for * already"),
        ((".", "--model", "=axis"), "write KIND=MODEL"),
        ((".", "--watch", "--json"), "--watch"),
    ],
)
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys, words, line):
    monkeypatch.chdir(tmp_path)
    assert main.run(["fleet", "--model", "axis", "--output", "out", *words]) == 2
    said = capsys.readouterr().err
    assert line in said
    assert said.count("\n") == 1


def test_a_date_after_all_recordings_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "t.csv").write_text("robot,joint,time,bag\nr,j,2026-03-01,b\n")
    words = ["fleet", str(tmp_path / "t.csv"), "--model", "axis", "--output", str(tmp_path / "out"), "--quiet"]
    assert main.run([*words, "--since", "2027-01-01"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_place_that_is_not_there_is_refused_before_the_engine_is_imported(tmp_path):
    heavy = {"distributed", "duckdb", "numba", "pyarrow", "scipy", "statsmodels"}
    words = ["fleet", "none", "--model", "axis", "--output", str(tmp_path / "out")]
    code = f"import sys; from idloop.cli import main; print(main.run({words}), {heavy} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "there is no such table or folder" in done.stderr
    assert done.stdout == "2 set()\n"


def test_a_fleet_of_which_nothing_is_identified_is_no_success(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bags" / "r1").mkdir(parents=True)
    (tmp_path / "bags" / "r1" / "2026-03-01.mcap").write_bytes(b"not a bag")
    words = ["fleet", "bags", "--model", "axis", "--output", "out", "--workers", "0", "--quiet"]
    assert main.run(words) == 1
    said = capsys.readouterr()
    assert "nothing was identified" in said.err
    assert "2026-03-01.mcap" in said.out
    assert (tmp_path / "out" / "fleet.html").exists()


def test_a_watch_ends_by_ctrl_c_as_asked(tmp_path, monkeypatch, capsys):
    def watch(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("idloop.api.fleet.watch_fleet", watch)
    assert main.run(["fleet", str(tmp_path), "--model", "axis", "--output", str(tmp_path / "out"), "--watch"]) == 0
    assert f"ended; what was found is in {tmp_path / 'out'}" in capsys.readouterr().err


@pytest.mark.parametrize("name", NEEDED)
def test_a_missing_extra_is_one_line(tmp_path, monkeypatch, capsys, name):
    (tmp_path / "t.csv").write_text("robot,joint,time,bag\nr,j,2026-03-01,b\n")
    monkeypatch.setitem(__import__("sys").modules, name, None)
    words = ["fleet", str(tmp_path / "t.csv"), "--model", "axis", "--output", str(tmp_path / "out"), "--quiet"]
    assert main.run(words) == 2
    said = capsys.readouterr().err
    assert "pip install 'idloop[fleet]'" in said
    assert said.count("\n") == 1
