"""From a log of a motor and its load to a model of two bodies."""

from __future__ import annotations

import pytest

import idloop

GEAR = """\
schema: idloop/model/1
name: gear
input: {joint: axis, unit: N·m}
outputs:
  - {joint: axis, field: position, unit: rad, noise: 0.0005}
  - {joint: load, field: position, unit: rad, noise: 0.00005, scale: 0.1}
bodies:
  - {name: axis, inertia: 0.05, viscous_friction: 0.2}
  - {name: load, inertia: 0.08, viscous_friction: 0.1}
couplings: [{from: axis, to: load, stiffness: 30.0, damping: 0.1}]
"""


@pytest.fixture
def log(tmp_path):
    (tmp_path / "gear.yaml").write_text(GEAR, encoding="utf-8")
    signal = idloop.excitation("multilevel", sample_time=0.005, duration=10.0, amplitude=3.0, seed=2)
    record = idloop.simulate(idloop.load_model(tmp_path / "gear.yaml"), signal, seed=2)
    rows = zip(record.time, record.input, *record.output.T, strict=True)
    lines = ["t [s],torque [Nm],motor pos [rad],load pos [rad]", *(f"{t:.3f},{u},{q},{p}" for t, u, q, p in rows)]
    (tmp_path / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    return tmp_path / "log.csv"


def test_a_load_with_a_sensor_of_its_own_is_a_second_body(log, tmp_path):
    begun = idloop.start(log, tmp_path / "begun", {"load": "load pos [rad]"})
    assert begun.fit.values["axis-load.stiffness"] == pytest.approx(30.0, rel=0.05)
    assert begun.fit.values["load.inertia"] == pytest.approx(0.08, rel=0.05)
    joints = begun.inspections[0].joints
    assert {name: one.grade for name, one in joints.items()} == {"axis": "usable", "load": "usable"}
    said = [line for line in begun.outcome() if isinstance(line, str)]
    (referred,) = [line for line in said if "times as far as axis" in line]
    assert referred.startswith("load.position moves 0.1 times")
    assert "divide them by 0.01 " in referred


def test_without_the_option_it_is_one_body_and_the_option_is_shown(log, tmp_path):
    begun = idloop.start(log, tmp_path / "begun", fitted=False)
    assert list(begun.model.bodies) == ["axis"]
    assert any(doubt.endswith("--load 'load pos [rad]'") for doubt in begun.log.doubts)
