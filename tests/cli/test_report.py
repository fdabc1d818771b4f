"""`idloop report`: the folder of a ladder as one page; what has moved or is missing is said in one line."""

from __future__ import annotations

import json
import shutil

import pytest

from idloop.cli import main


def words(*arguments: object) -> list[str]:
    return [str(argument) for argument in arguments]


@pytest.fixture
def run(refined, tmp_path):
    """Copy of the ladder to work on."""
    return shutil.copytree(refined, tmp_path / "run")


def page_of(folder) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def test_refine_leaves_the_report_and_where_it_comes_from(refined, hidden):
    html = page_of(refined)
    assert "Missing from the model: dead zone." in html
    document = json.loads((refined / "ladder.json").read_text(encoding="utf-8"))
    origin = document["provenance"]
    assert origin["seed"] == 0
    (command,) = origin["commands"]
    assert command.startswith(f"idloop refine {hidden.model} {hidden.levels} --validate {hidden.unseen}")
    assert "--most 3" in command
    assert [bag["use"] for bag in origin["bags"]] == ["fitted", "unseen"]
    for bag in origin["bags"]:
        assert len(bag["sha256"]) == 64
        assert bag["sha256"] in html
    assert command in html


@pytest.mark.slow
def test_the_report_is_written_again_alike(run, refined, capsys):
    (run / "report.html").unlink()
    assert main.run(words("report", run, "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "idloop/report/1"
    assert document["added"] == ["dead_zone@input"]
    assert document["bytes"] == (run / "report.html").stat().st_size < 5_000_000
    before, after = page_of(refined), page_of(run)
    # The figures' names inside Bokeh are new each time; every word and number is not.
    cut = before.index("<script>")
    assert after[:cut] == before[:cut]


@pytest.mark.slow
def test_another_file_and_the_figures_of_a_paper(run, tmp_path, capsys):
    target, figures = tmp_path / "mailed.html", tmp_path / "figures"
    assert main.run(words("report", run, "--output", target, "--svg", figures)) == 0
    assert target.stat().st_size > 1_000_000
    names = {path.name for path in figures.iterdir()}
    assert {"ladder.svg", "compare_1_unseen.svg", "where_1_unseen.svg", "compare_2_fitted.svg"} <= names
    assert "written:" in capsys.readouterr().err
    assert b"<svg" in (figures / "ladder.svg").read_bytes()


@pytest.mark.slow
def test_recordings_that_have_moved_are_named(run, hidden, tmp_path, capsys):
    moved = shutil.copytree(hidden.levels, tmp_path / "moved")
    document = json.loads((run / "ladder.json").read_text(encoding="utf-8"))
    document["bags"] = [str(tmp_path / "gone")]
    (run / "ladder.json").write_text(json.dumps(document), encoding="utf-8")
    assert main.run(words("report", run)) == 2
    assert "name it by --bag" in capsys.readouterr().err
    assert main.run(words("report", run, "--bag", moved)) == 0
    assert "checksum" not in capsys.readouterr().err
    assert main.run(words("report", run, "--bag", hidden.two)) == 0
    assert "its checksum differs" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    (
        (["nowhere"], "ladder.json"),
        (["RUN", "--output", "no/such/folder/report.html"], "no folder"),
        (["RUN", "--svg", "RUN/ladder.json"], "this is a file"),
        (["RUN", "--pdf", "RUN"], "this is a folder"),
    ),
)
def test_wrong_use_is_one_line(refined, arguments, said, capsys, monkeypatch):
    asked = [word.replace("RUN", str(refined)) for word in arguments]
    assert main.run(words("report", *asked)) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_no_browser_for_the_pdf_is_said_before_the_work(refined, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("IDLOOP_CHROMIUM", "no-such-browser")
    before = (refined / "report.html").stat().st_mtime_ns
    assert main.run(words("report", refined, "--pdf", tmp_path / "report.pdf")) == 2
    assert "install chromium" in capsys.readouterr().err
    assert (refined / "report.html").stat().st_mtime_ns == before
