"""The SQL of the page about fleets runs on the results of a fleet."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import idloop
from benchmarks import fleet as simulated
from idloop.physics.model_file import from_text

duckdb = pytest.importorskip("duckdb")
pytest.importorskip("distributed")

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "fleet.md").read_text(encoding="utf-8")
QUESTIONS = re.findall(r"^```sql\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    plan = simulated.Fleet(1, 2, 2, missing=0.0, broken=0.0)
    simulated.write_robot(folder / "bags", plan, 0)
    (folder / "bags" / "robot000" / "broken.mcap").write_bytes(b"not a bag")
    for share in (2, 3):
        cut = shutil.copytree(folder / "bags" / "robot000" / "2026-03-01", folder / "bags" / "robot001" / str(share))
        (file,) = cut.glob("*.mcap")
        file.write_bytes(file.read_bytes()[: file.stat().st_size // share])
    # The joint of the page's model is called motor.
    base, wrist = (from_text(text.replace("axis", "motor"), None) for text in simulated.KINDS.values())
    found = idloop.identify_fleet(
        folder / "bags", {"j0": base, "*": wrist}, folder / "runs" / "fleet", workers=0, diagnose=0
    )
    found.save()
    return folder


def test_there_are_questions():
    assert len(QUESTIONS) >= 5


@pytest.mark.parametrize("sql", QUESTIONS)
def test_every_question_is_answered_as_it_stands(place, sql, monkeypatch):
    monkeypatch.chdir(place)
    answer = duckdb.sql(sql)
    if "findings" in sql:
        assert "kind_mean" in answer.columns
    elif sql.startswith("copy"):
        assert (place / "runs" / "fleet" / "all.parquet").exists()
    else:
        rows = answer.fetchall()
        assert rows
        if "why" in sql:
            assert max(count for _, count in rows) == 2, "the two that are cut off, at different places"


def test_the_page_names_every_column():
    from idloop.fleet.store import COLUMNS

    assert [name for name in COLUMNS if not re.search(rf"\b{name}\b", PAGE)] == []
