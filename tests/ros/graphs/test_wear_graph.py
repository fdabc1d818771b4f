"""Whole graphs that watch wear: the healthy machine leaves no alarm in its bag, the one with more friction does."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.graph import load_graph, run_graph
from idloop.physics import load_model
from idloop_nodes.codec import decode_diagnostics

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.usefixtures("ros_environment"),
]
LEVEL = "coulomb_friction@motor.level"
QUIET = {"fit_period": "0.0", "auto_diagnose": "false"}
WATCH = QUIET | {"monitor": f"['{LEVEL}=100%']", "monitor_false_alarms": "per 100 h"}


def wear(bag):
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        return [decode_diagnostics(bytes(data))[1] for _, _, data in reader.messages(
            connections=[one for one in reader.connections if one.topic == "/estimator/wear"]
        )]  # fmt: skip


def run(bag, **values):
    lines = []
    graph = load_graph("dc_motor", WATCH | {"bag": str(bag)} | values)
    assert run_graph(graph, say=lambda label, line: lines.append(f"{label}: {line}")), lines
    return lines


@pytest.mark.slow
def test_friction_that_has_grown_is_noticed_and_health_is_not(tmp_path):
    model = tmp_path / "healthy.yaml"
    load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"]).save(model)
    healthy, worn = tmp_path / "healthy", tmp_path / "worn"

    run(
        healthy, duration="160.0", model=str(model), monitor_learn="110.0",
        effects="['coulomb_friction@motor(level=0.8)']",
    )  # fmt: skip
    found = wear(healthy)
    assert found[0][1].values["blocks"] == "0"  # what the reference showed
    assert found[-1][1].values["alarms"] == "0"
    assert int(found[-1][1].values["blocks"]) >= 20
    assert not any(head.values["error"] for head, *_ in found)

    lines = run(
        worn, duration="60.0", model=str(model), seed="3", monitor_reference=f"['{healthy}']",
        effects="['coulomb_friction@motor(level=1.6)']",
    )  # fmt: skip
    found = wear(worn)
    _, watch = found[-1]
    assert watch.values["state"] == "alarm"
    assert float(watch.values["low"]) < 0.8 < float(watch.values["high"])
    assert 10**9 < int(watch.values["first"]) < 40 * 10**9
    assert any(f"wear of {LEVEL}" in line for line in lines), lines
