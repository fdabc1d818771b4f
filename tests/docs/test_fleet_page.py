"""The SQL of the page about fleets runs on the results of a fleet."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import idloop
from benchmarks import fleet as simulated

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
    found = idloop.identify_fleet(
        folder / "bags", {"j0": simulated.models()["base"], "*": simulated.models()["wrist"]},
        folder / "runs" / "fleet", workers=0, diagnose=0,
    )  # fmt: skip
    found.save()
    return folder


def test_there_are_questions():
    assert len(QUESTIONS) >= 5


@pytest.mark.parametrize("sql", QUESTIONS)
def test_every_question_is_answered(place, sql):
    answer = duckdb.sql(sql.replace("runs/fleet", str(place / "runs" / "fleet")))
    if "findings" in sql:
        assert "kind_mean" in answer.columns
    elif sql.startswith("copy"):
        assert (place / "runs" / "fleet" / "all.parquet").exists()
    else:
        assert answer.fetchall()


def test_the_page_names_every_column():
    from idloop.fleet.store import COLUMNS

    assert [name for name in COLUMNS if not re.search(rf"\b{name}\b", PAGE)] == []
