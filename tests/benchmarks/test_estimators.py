"""The benchmark of the black-box estimators: every method takes its records, and theory is seen."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "benchmarks" / "estimators.py"


@pytest.fixture(scope="module")
def estimators():
    specification = importlib.util.spec_from_file_location("benchmark_of_estimators", FILE)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_a_known_controller_is_right_in_open_and_in_closed_loop_and_nothing_known_is_not(estimators):
    rows = estimators.consistency(2, methods=("vodma", "vodma-direct"))
    assert len(rows) == 4
    assert all(row["as_claimed"] for row in rows)


def test_every_case_takes_its_records(estimators):
    for method, noise, settings, *_ in estimators.CASES:
        for loop in ("open", "closed"):
            assert estimators.root_mean_square(method, noise, 1000, 1, loop, settings) < 25.0, method


def test_every_method_that_gives_a_linear_model_has_a_case(estimators):
    from idloop.estimation.black_box.methods import METHODS

    named = {case[0] for case in estimators.CASES}
    other = {name for name, method in METHODS.items() if method.kind in ("network", "response")}
    assert set(METHODS) - named == other
