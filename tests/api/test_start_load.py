"""From a log of a motor and its load to a model of two bodies."""

from __future__ import annotations

import numpy as np
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


@pytest.mark.parametrize("name", ["torque_Nm", "pwm"])
def test_a_load_whose_inertia_does_not_show_is_left_out_so_that_the_next_command_works(name, tmp_path):
    """A stiff gear, and coarse encoders."""
    random, rate, ratio = np.random.default_rng(41), 100.0, 5.0
    time = np.arange(800) / rate
    turns, phases = 2.0 * np.pi * random.uniform(0.2, 5.0, size=6), random.uniform(0.0, 6.0, size=6)
    command = 0.02 * np.sin(np.outer(time, turns) + phases).sum(axis=1)
    angle, place, speed = np.empty(800), 0.0, 0.0
    for k, value in enumerate(command):
        angle[k] = place
        for _ in range(20):
            speed += 0.05 / rate * (value - 0.002 * speed - 0.01 * np.tanh(speed / 0.02)) / 0.0005
            place += 0.05 / rate * speed
    count, scale = 400 * angle / (2.0 * np.pi), 1.0 if name == "torque_Nm" else 2000.0
    columns = (1e3 * time, command * scale, count // 1, count / ratio // 1)
    rows = "\n".join(f"{t:.0f},{u:.6f},{m:.0f},{p:.0f}" for t, u, m, p in zip(*columns, strict=True))
    (tmp_path / "log.csv").write_text(f"time_ms,{name},motor_counts,load_counts\n{rows}\n")
    given = {"position": "motor_counts=counts/400", "load": "load_counts=counts/400"}
    begun = idloop.start(tmp_path / "log.csv", tmp_path / "begun", given)
    assert list(begun.model.bodies) == ["axis"]
    assert "load.position shows no inertia of its own" in begun.summary()
    assert idloop.diagnose(idloop.load_model(begun.fitted_file), begun.records).summary()
