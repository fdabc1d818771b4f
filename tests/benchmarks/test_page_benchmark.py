"""What the benchmark of the page says of a run: reached or not, and at which load."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "workbench.py"


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("benchmark_of_the_page", FILE)
    module = importlib.util.module_from_spec(spec)
    # A dataclass looks its module up.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def counted(steps, samples, lost=0):
    return {
        "plant: loop": {"steps": steps},
        "controller: loop": {"silences": 0},
        "estimator: prediction": {"samples": samples, "restarts": 0},
        "recorder: recording": {"lost/joint_states": lost, "lost/joint_command": 0, "dropped_by_queue": 0},
    }


def run(benchmark, pictures, load, *, lost=0):
    memory = [{"node": 120.0 + 5.0 * min(k, 2), "browser": 400.0, "heap": 14.0} for k in range(6)]
    before = benchmark.Phase("without", counted(0, 0), counted(60_000, 60_000), [1.0], 60.0)
    opened = benchmark.Phase(
        "with", counted(60_000, 60_000), counted(660_000, 659_997, lost), load, 600.0, pictures, memory
    )
    return benchmark.verdicts(before, opened)


def test_a_run_that_reaches_what_was_asked_says_so(benchmark):
    lines = run(benchmark, [16.0, 15.0], [1.0, 1.2])
    assert lines[0] == "10 pictures a second: reached in every part"
    assert lines[1] == "measured, not predicted in time: 3 with the page, 0 without"
    assert "recorder, lost/joint states: 0 with the page, 0 a second; 0 a second without" in lines
    assert "memory of the node: +0.0 MB over the second half" in lines


def test_a_busy_machine_is_told_beside_what_was_not_reached(benchmark):
    lines = run(benchmark, [16.0, 3.0, 8.0], [1.0, 19.0, 17.0], lost=60)
    assert lines[0] == (
        "10 pictures a second: not reached in 2 of 3 parts, fewest 3.0; the load was 17.0 or more in all of them"
    )
    assert "recorder, lost/joint states: 60 with the page, 0.1 a second; 0 a second without" in lines
