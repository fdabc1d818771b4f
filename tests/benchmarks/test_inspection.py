"""Planted faults are named, clean recordings have none: a few of each kind of the benchmark."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "benchmarks" / "inspection.py"


@pytest.fixture(scope="module")
def rates():
    specification = importlib.util.spec_from_file_location("benchmark_of_inspection", FILE)
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_clean_records_have_no_fault(rates):
    found = [kind for seed in range(1000, 1030) for kind in rates.clean(seed)]
    assert len(found) <= 1


@pytest.mark.slow
def test_planted_faults_are_named(rates):
    hits = {case.title: sum(rates.planted((k, seed)) for seed in range(200, 204)) for k, case in enumerate(rates.CASES)}
    assert sum(hits.values()) >= 0.85 * 4 * len(hits)
    assert min(hits.values()) >= 1


@pytest.mark.slow
def test_records_of_two_gains_are_told_apart(rates):
    assert sum(rates.pair((2.0, seed)) for seed in range(6)) >= 3
    assert sum(rates.pair((1.0, seed)) for seed in range(6)) == 0


@pytest.mark.slow
def test_measured_recordings_have_the_faults_of_their_descriptions(rates, data_dir, capsys):
    count, there, false = rates.measured_sets(data_dir)
    assert count >= 100
    assert there["late_velocity"] >= 10
    assert there["measured_input"] == 3
    assert sum(false.values()) <= 2
