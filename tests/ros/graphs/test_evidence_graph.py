"""A whole graph with a hidden effect: its evidence rises in the bag, and the experiment ends by itself."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph import load_graph, read_findings, run_graph
from idloop.physics import load_model
from idloop.records import read_record

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.whole_graph,
    pytest.mark.timeout(1800),
    pytest.mark.usefixtures("ros_environment"),
]
QUIET = {"duration": "45.0", "auto_diagnose": "false", "window": "8.0", "validation": "4.0"}


def run(bag, **values):
    lines = []
    graph = load_graph("dc_motor", QUIET | {"bag": str(bag)} | values)
    assert run_graph(graph, say=lambda label, line: lines.append(f"{label}: {line}")), lines
    return read_findings(bag).evidence, read_record(bag, load_model("dc_motor"))


def course(evidence, name):
    return [one["log_e"] for look in evidence for one in look["candidates"] if one["name"] == name]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "name"),
    [
        ("dead_zone@input(width=0.2)", "dead_zone@input"),
        ("coulomb_friction@motor(level=1.0)", "coulomb_friction@motor"),
    ],
)
def test_the_evidence_for_a_hidden_effect_rises_and_the_experiment_ends_by_itself(tmp_path, effect, name):
    watched, record = run(tmp_path / "watched", effects=f"['{effect}']")
    rising = course(watched, name)
    assert len(rising) >= 6
    assert np.mean(np.diff(rising) > 0.0) > 0.7
    assert rising[-1] > watched[-1]["threshold"]
    assert not any(look["ended"] for look in watched)
    assert np.any(record.input[-200:] != 0.0), "unless asked, nothing is stopped"

    ended, record = run(tmp_path / "ended", effects=f"['{effect}']", end_when_decided="true")
    assert name in [one["name"] for one in ended[-1]["candidates"] if one["decided_stamp"] is not None]
    assert ended[-1]["ended"]
    assert ended[-1]["stamp"] < 30 * 10**9
    # The machine may be ahead of its estimator by a thousand samples.
    after = record.input_time > ended[-1]["stamp"] * 1e-9 - record.start_ns * 1e-9 + 10.5
    assert np.any(after)
    assert np.all(record.input[after] == 0.0)


@pytest.mark.slow
def test_a_machine_that_lacks_nothing_ends_with_estimates_that_may_be_trusted(tmp_path):
    ended, record = run(tmp_path / "bag", end_when_decided="true")
    truth = load_model("dc_motor").values
    assert ended[-1]["ended"]
    assert not any(one["decided_stamp"] for one in ended[-1]["candidates"])
    assert all(one["trusted"] and one["why"] for one in ended[-1]["parameters"])
    for one in ended[-1]["parameters"]:
        assert abs(one["value"] - truth[one["name"]]) < 5.0 * one["stderr"]
    assert np.all(record.input[-500:] == 0.0)
