"""`idloop start`: guesses with reasons, flags, questions on a terminal, and one line for every mistake."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import idloop
from idloop.cli import main
from idloop.cli.verbs import start
from idloop.records.tables.mapping import load_mapping


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
        (["--rate", "inf", "--command", "i_set"], "above zero and finite"),
        (["--rate", "nan", "--command", "i_set"], "above zero and finite"),
        (["--delimiter", ";;"], "--delimiter ';;' is not one character"),
        (["--rate", "100", "--rows", "7"], "--rows '7' are none: give FROM:TO"),
        (["--rate", "100", "--rows", "9:9"], "holds nothing"),
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


@pytest.fixture
def answers(monkeypatch):
    """Answer the questions of a terminal with these texts, one after the other."""

    def given(*texts):
        left = iter(texts)
        monkeypatch.setattr(start, "_on_terminal", lambda: True)
        monkeypatch.setattr("click.prompt", lambda *_, **__: next(left))

    return given


def test_on_a_terminal_the_guess_is_changed_until_it_is_right(log, tmp_path, capsys, answers):
    answers("", "rate=100", "command=i_set=N·m", "nonsense", "position==deg", "")
    code, _, err = _run(capsys, log, "--output", tmp_path / "a", "--no-fit")
    assert code == 0, err
    assert "no column is a time" in err
    assert "not understood: 'nonsense'" in err
    assert "picture: " in err
    mapping = (tmp_path / "a" / "mapping.yaml").read_text()
    assert "unit: deg" in mapping
    assert "unit: N·m" in mapping


def test_a_refused_answer_leaves_what_is_shown(log, tmp_path, capsys, answers):
    answers("position=angel", "speed=angle", "rate=many", "n", "command=i_set=miles", "y")
    code, out, err = _run(capsys, log, "--rate", 100, "--command", "i_set=N·m", "--output", tmp_path / "a", "--no-fit")
    assert code == 0, err
    assert out.count("signal ") == 1
    assert err.count("not changed: the table above holds") == 2
    for text in ("no column 'angel'", "no signal 'speed'", "'many' rows per second", "say what to change"):
        assert text in err
    mapping = load_mapping(tmp_path / "a" / "mapping.yaml")
    assert (mapping.command[0].column, mapping.command[0].unit) == ("i_set", "N·m")


def test_the_picture_of_the_question_is_removed(log, tmp_path, capsys, answers):
    answers("")
    _, _, err = _run(capsys, log, "--rate", 100, "--command", "i_set", "--output", tmp_path / "a", "--no-fit")
    picture = Path(err.partition("picture: ")[2].splitlines()[0])
    assert picture.name == "log.png"
    assert not picture.parent.exists()


def test_a_folder_that_is_there_is_refused_before_anything_is_asked(log, tmp_path, capsys, answers, monkeypatch):
    answers()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log").mkdir()
    code, _, err = _run(capsys, log, "--rate", 100, "--command", "i_set")
    assert code == 2
    assert "exists already" in err


def test_what_cannot_be_fitted_ends_with_one(tmp_path, capsys):
    t = np.arange(300) * 0.01
    columns = np.column_stack([t, 0 * t + 1.0, np.maximum(t - 1.0, 0.0) ** 2])
    np.savetxt(tmp_path / "log.csv", columns, delimiter=",", header="t,torque,angle", comments="")
    code, out, _ = _run(capsys, tmp_path / "log.csv", "--output", tmp_path / "a")
    assert code == 1
    assert "not fitted: " in out
    assert "next:" not in out


def test_on_a_terminal_q_stops_before_anything_is_written(log, tmp_path, capsys, answers):
    answers("q")
    assert _run(capsys, log, "--output", tmp_path / "a")[0] == 0
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("said", ["tab", "\\t", "\t"])
def test_a_tab_between_the_cells_can_be_said(tmp_path, capsys, said):
    rows = "".join(f"{0.01 * k:.2f}\t{(-1) ** (k // 40)}\t{0.1 * k:.1f}\n" for k in range(200))
    (tmp_path / "log.tsv").write_text(f"t [s]\tu [V]\tq [rad]\n{rows}")
    code, out, _ = _run(capsys, tmp_path / "log.tsv", "--delimiter", said, "--output", tmp_path / "a", "--no-fit")
    assert code == 0
    assert "u [V]" in out


def test_what_was_recognised_stands_before_a_later_refusal(tmp_path, capsys):
    t = np.arange(300) * 0.01
    angle = np.sin(t)
    angle[7] = np.inf
    columns = np.column_stack([t, np.cos(t), angle])
    np.savetxt(tmp_path / "log.csv", columns, delimiter=",", header="t,torque,angle", comments="")
    code, out, err = _run(capsys, tmp_path / "log.csv", "--output", tmp_path / "a")
    assert code == 2
    assert "by its name (angle)" in out
    assert "column 'angle' is infinite in row 7" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "a").exists()
