"""Of good velocities hardly any is told to be wrong, of wrong ones nearly all are."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "benchmarks" / "velocity_check.py"


@pytest.fixture(scope="module")
def rates():
    specification = importlib.util.spec_from_file_location("benchmark_of_velocities", FILE)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_no_good_velocity_is_told_to_be_wrong(rates):
    counts = [rates.told(column, kind, 3, seed=1) for column in rates.GOOD.values() for kind in rates.MOTIONS]
    assert len(counts) * 3 >= 200
    assert sum(wrong for wrong, _ in counts) == 0
    assert sum(right for _, right in counts) >= 150


def test_wrong_velocities_are_told(rates):
    moving = [kind for kind in rates.MOTIONS if kind not in ("step", "one way")]
    counts = [rates.told(column, kind, 2, seed=1) for column in rates.BAD.values() for kind in moving]
    assert len(counts) * 2 >= 100
    assert sum(wrong for wrong, _ in counts) >= 0.9 * 2 * len(counts)
