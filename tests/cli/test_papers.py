"""`idloop papers`: the list of rows, a row as tables, JSON and a figure, and exit codes."""

from __future__ import annotations

import json

import pytest

import papers
from idloop.cli import main
from idloop.reporting.text.blocks import as_text
from papers.claim import near
from papers.reproduction import Line, Reproduction, Table


def _run(capsys, *words: str) -> tuple[int, str, str]:
    code = main.run(["papers", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_without_a_row_all_are_listed(capsys) -> None:
    code, out, _ = _run(capsys)
    assert code == 0
    assert all(name in out and row.title in out for name, row in papers.ROWS.items())
    code, out, _ = _run(capsys, "--json")
    assert [entry["row"] for entry in json.loads(out)["rows"]] == list(papers.ROWS)


@pytest.mark.parametrize(
    ("words", "expected"),
    (
        (["A99"], "no row 'A99'"),
        (["A1", "--seed", "-1"], "--seed"),
        (["A1", "--seed", "x"], "--seed"),
        (["A1", "--plot", "a1.txt"], "suffix"),
        (["A1", "A2"], "A2"),
        (["A1", "--part", "friction"], "has no parts"),
        (["B2", "--part", "frction"], "friction"),
        (["--part", "friction"], "--part needs a row"),
    ),
)
def test_wrong_use_is_one_line_and_exit_code_2(words: list[str], expected: str, capsys) -> None:
    code, out, err = _run(capsys, *words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert expected in err


def test_a_row_for_people(capsys) -> None:
    code, out, err = _run(capsys, "a1")
    assert code == 0
    assert err == ""
    heads = ("A1: The DC motor as a model", "quantity", "ours", "paper", "source", "claimed", "holds")
    for words in (*heads, "8.255", "eq. 7.1", "8.255 ± 0.01 %", "yes"):
        assert words in out


@pytest.mark.slow
def test_json_and_plot(tmp_path, capsys) -> None:
    figure = tmp_path / "a1.svg"
    code, out, err = _run(capsys, "A1", "--json", "--seed", "3", "--plot", str(figure))
    assert code == 0
    document = json.loads(out)
    assert (document["schema"], document["row"], document["seed"]) == ("idloop/papers/1", "A1", 3)
    assert document["holds"] is True
    first = document["rows"][0]
    assert (first["paper"], first["claim"], first["holds"]) == (8.255, "8.255 ± 0.01 %", True)
    assert document["plot"] == str(figure)
    assert "phase [deg]" in figure.read_text(encoding="utf-8")
    assert "written" in err


class Missed(Reproduction):
    def rows(self) -> tuple[Line, ...]:
        return (Line("gain", 3.0, 2.0, "V", "p. 1", near(2.0, 0.5)), Line("size", None, "large"))

    def tables(self) -> tuple[Table, ...]:
        return (Table("More", ("a", "b"), [(1.0, "x")]),)

    def notes(self) -> tuple[str, ...]:
        return ("A note.",)

    def plot(self, axes=None):
        raise NotImplementedError


def test_a_row_that_does_not_hold_is_exit_code_1(capsys, monkeypatch) -> None:
    monkeypatch.setattr(papers, "reproduce", lambda name, seed, progress, parts: Missed())
    code, out, err = _run(capsys, "A1")
    assert code == 1
    assert "gain [V]" in out
    assert "2 ± 0.5 V  NO" in out
    assert err == "A1: 1 of 2 lines do not hold\n"


def test_tables_and_notes_are_printed() -> None:
    out = as_text(Missed().blocks())
    assert "More" in out
    assert "- A note." in out
    assert "large" in out
