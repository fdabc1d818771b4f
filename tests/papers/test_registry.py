"""The registry of the papers' rows, and what every row gives."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys

import pytest

from idloop import papers
from idloop.errors import InputError
from idloop.papers.reproduction import Line, Reproduction, Table, within


@pytest.mark.parametrize("name", papers.ROWS)
def test_every_row_is_there_and_takes_a_seed_and_a_progress(name: str) -> None:
    module, _, function = papers.ROWS[name].place.partition(":")
    run = getattr(importlib.import_module(f"idloop.papers.{module}"), function)
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
    code = "import sys, idloop.papers; print(*{'numpy', 'scipy', 'numba', 'control', 'matplotlib'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


class Small(Reproduction):
    def __init__(self, *holds: bool | None) -> None:
        self.lines = tuple(Line("size", 1.0, 2.0, "m", "table 1", one) for one in holds)

    def rows(self) -> tuple[Line, ...]:
        return self.lines

    def plot(self, axes=None):
        raise NotImplementedError


@pytest.mark.parametrize(("holds", "all_hold"), [((True, None), True), ((True, False), False), ((), True)])
def test_a_row_holds_when_no_line_is_missed(holds: tuple[bool | None, ...], all_hold: bool) -> None:
    found = Small(*holds)
    assert found.holds is all_hold
    assert found.to_dict()["holds"] is all_hold
    assert [line["holds"] for line in found.to_dict()["rows"]] == list(holds)
    assert found.tables() == found.notes() == ()


def test_tables_are_plain_values() -> None:
    table = Table("T", ("a", "b"), [(1.0, "x"), (None, "y")])
    assert table.to_dict() == {"title": "T", "header": ["a", "b"], "rows": [[1.0, "x"], [None, "y"]]}


def test_a_share_of_the_papers_number() -> None:
    assert within(-1.05, -1.0, 0.06)
    assert not within(-1.05, -1.0, 0.04)
