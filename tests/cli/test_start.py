"""`idloop start`: guesses with reasons, flags, questions on a terminal, and one line for every mistake."""

from __future__ import annotations

import json

import numpy as np
import pytest

import idloop
from idloop.cli import main
from idloop.cli.verbs import start


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=10.0, amplitude=0.5, seed=3)
    record = idloop.simulate(idloop.load_model("axis"), signal, seed=3)
    path = tmp_path_factory.mktemp("log") / "log.csv"
    columns = np.column_stack([record.input, np.degrees(record.output[:, 0])])
    np.savetxt(path, columns, delimiter=",", header="i_set,angle", comments="")
    return path


def _run(capsys, *words):
    code = main.run(["start", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def test_flags_say_what_the_file_does_not(log, tmp_path, capsys):
    code, out, _ = _run(
        capsys, log, "--rate", 100, "--command", "i_set=N·m", "--position", "=deg", "--output", tmp_path / "a"
    )
    assert code == 0, out
    assert "every 0.01 s" in out
    assert "axis.inertia" in out
    assert f"idloop diagnose {tmp_path / 'a' / 'fitted.yaml'}" in out
    assert "check: no name says what 'i_set' is" not in out


def test_json_is_one_document(log, tmp_path, capsys):
    code, out, _ = _run(
        capsys, log, "--rate", 100, "--command", "i_set", "--output", tmp_path / "a", "--no-fit", "--json"
    )
    document = json.loads(out)
    assert code == 0
    assert document["time"]["period"] == 0.01
    assert document["not_fitted"] == "not asked for"
    assert document["doubts"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--command", "i_set"], "--rate HZ or --period S"),
        (["--rate", "100", "--period", "0.01"], "--rate and --period say the same"),
        (["--rate", "100", "--position", "angle=miles"], "unknown unit 'miles'"),
        (["--rate", "100", "--command", "current"], "no column 'current' for the command"),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(log, tmp_path, capsys, words, message):
    code, out, err = _run(capsys, log, *words, "--output", tmp_path / "a")
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "a").exists()


def test_on_a_terminal_the_guess_is_changed_until_it_is_right(log, tmp_path, capsys, monkeypatch):
    answers = iter(["", "rate=100", "command=i_set=N·m", "nonsense", "position==deg", ""])
    monkeypatch.setattr(start, "_on_terminal", lambda: True)
    monkeypatch.setattr("click.prompt", lambda *_, **__: next(answers))
    code, _, err = _run(capsys, log, "--output", tmp_path / "a", "--no-fit")
    assert code == 0, err
    assert "no column is a time" in err
    assert "not understood: 'nonsense'" in err
    assert "picture: " in err
    mapping = (tmp_path / "a" / "mapping.yaml").read_text()
    assert "unit: deg" in mapping
    assert "unit: N·m" in mapping


def test_on_a_terminal_q_stops_before_anything_is_written(log, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(start, "_on_terminal", lambda: True)
    monkeypatch.setattr("click.prompt", lambda *_, **__: "q")
    assert _run(capsys, log, "--output", tmp_path / "a")[0] == 0
    assert not (tmp_path / "a").exists()
