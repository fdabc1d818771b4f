"""The registry of the papers' rows, and what every row gives."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import papers
from idloop.errors import InputError
from papers.claim import below, stated
from papers.reproduction import Line, Reproduction, Table


@pytest.mark.parametrize("name", papers.ROWS)
def test_every_row_is_there_and_takes_a_seed_and_a_progress(name: str) -> None:
    module, _, function = papers.ROWS[name].place.partition(":")
    run = getattr(importlib.import_module(f"papers.{module}"), function)
    assert list(inspect.signature(run).parameters)[:2] == ["seed", "progress"]


def test_rows_are_found_in_any_case() -> None:
    assert papers.find_row("a3") == "A3"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: papers.reproduce("A99"), "no row 'A99'.*known: A1, A2"),
        (lambda: papers.find_row(""), "no row ''"),
        (lambda: papers.reproduce("A1", -1), "seed -1"),
    ],
)
def test_wrong_use_in_one_line(make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_the_list_of_rows_imports_nothing_heavy() -> None:
    code = "import sys, papers; print(*{'numpy', 'scipy', 'numba', 'control', 'matplotlib'} & set(sys.modules))"
    examples = str(Path(papers.__file__).parents[1])
    found = subprocess.run([sys.executable, "-c", code], cwd=examples, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


class Small(Reproduction):
    def __init__(self, *holds: bool | None) -> None:
        claims = [None if one is None else stated("small", one) for one in holds]
        self.lines = tuple(Line("size", 1.0, 2.0, "m", "table 1", claim) for claim in claims)

    def rows(self) -> tuple[Line, ...]:
        return self.lines

    def plot(self, axes=None):
        raise NotImplementedError


@pytest.mark.parametrize(("holds", "all_hold"), [((True, None), True), ((True, False), False), ((), True)])
def test_a_row_holds_when_no_line_is_missed(holds: tuple[bool | None, ...], all_hold: bool) -> None:
    found = Small(*holds)
    assert found.holds is all_hold
    assert found.to_dict()["holds"] is all_hold
    rows = found.to_dict()["rows"]
    assert [line["holds"] for line in rows] == list(holds)
    assert [line["claim"] for line in rows] == [None if one is None else "small" for one in holds]
    assert found.tables() == found.notes() == ()


def test_tables_are_plain_values() -> None:
    table = Table("T", ("a", "b"), [(1.0, "x"), (None, "y")])
    assert table.to_dict() == {"title": "T", "header": ["a", "b"], "rows": [[1.0, "x"], [None, "y"]]}


@pytest.mark.parametrize(("ours", "holds"), [(1.9, True), (2.0, False), (float("nan"), False)])
def test_the_claim_decides_by_the_number_that_is_printed(ours: float, holds: bool) -> None:
    line = Line("size", ours, None, "m", "", below(2.0))
    assert line.holds is holds
    assert (line.to_dict()["ours"], line.to_dict()["claim"]) == (pytest.approx(ours, nan_ok=True), "< 2 m")
