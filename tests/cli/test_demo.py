"""The demo, shortened: a live graph, an offline fit and a replay that agree."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from idloop.cli.demo import distance, windows_of


@pytest.mark.ros
@pytest.mark.slow
def test_the_loop_runs_from_end_to_end(tmp_path: Path, ros_environment: dict[str, str], ros_domain_id: int) -> None:
    words = ["--graph", "dc_motor", "--seconds", "15", "--directory", str(tmp_path / "demo"), "--json"]
    run = subprocess.run(
        [sys.executable, "-m", "idloop.cli", "demo", *words, "--domain", str(ros_domain_id)],
        env=ros_environment | {"IDLOOP_DATA": os.devnull},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    (story,) = document["runs"]
    assert document["failures"] == []
    assert story["worst_fit"] > 95.0
    assert story["apart"]["the replay"] == 0.0
    for name, truth in story["truth"].items():
        found = story["offline"][name]
        assert abs(found["value"] - truth) < 4.0 * found["stderr"]
    assert (tmp_path / "demo" / "dc_motor" / "metadata.yaml").is_file()


def test_the_distance_of_two_estimates_is_in_combined_standard_errors() -> None:
    one = {"a": {"value": 1.0, "stderr": 0.3}, "b": {"value": 5.0, "stderr": None}}
    other = {"a": {"value": 2.0, "stderr": 0.4}, "b": {"value": 5.0, "stderr": None}}
    assert distance(one, other) == pytest.approx(2.0)
    other["b"]["value"] = 5.1
    assert distance(one, other) == float("inf")


@pytest.mark.parametrize("seconds", [6.0, 20.0, 60.0, 600.0])
@pytest.mark.parametrize("graph", ["dc_motor", "torsion"])
def test_a_live_run_has_room_for_two_fits(graph: str, seconds: float) -> None:
    windows = windows_of(graph, seconds)
    assert windows.window + windows.validation + windows.period <= seconds
