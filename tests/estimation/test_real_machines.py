from pathlib import Path

import numpy as np
import pytest

from idloop.estimation import fit
from idloop.physics import load_model
from idloop.records import read_record
from idloop.records.tables.importing import import_bag
from idloop.validation import compare

MOTOR = """
schema: idloop/model/1
name: motor
input: {topic: joint_command, joint: motor, field: effort, unit: V}
outputs:
  - {topic: joint_states, joint: motor, field: velocity, unit: rad/s}
bodies:
  - {name: motor, inertia: 1.0, viscous_friction: {value: 10.0, min: 0.0}}
couplings: []
drive: {gain: {value: 100.0, min: 0.0}}
effects: []
"""
PENDULUM = """
schema: idloop/model/1
name: servo
input: {topic: joint_command, joint: servo, field: effort, unit: V}
outputs:
  - {topic: joint_states, joint: servo, field: position, unit: rad}
bodies:
  - {name: servo, inertia: {value: 0.05, min: 0.0}, viscous_friction: {value: 0.5, min: 0.0}}
couplings: []
drive: {gain: 1.0}
effects:
  - {effect: imbalance, at: servo, amplitude: {value: 0.1}, phase: {value: 0.0}}
  - {effect: coulomb_friction, at: servo, level: {value: 0.05}}
"""


def source(folder: Path, pattern: str, number: int = 0) -> Path:
    found = sorted(folder.glob(pattern))
    if len(found) <= number:
        pytest.skip(f"no {folder / pattern}: set IDLOOP_DATA to the folder of the measured data")
    return found[number]


def test_open_loop_motor_follows_the_free_run(data_dir: Path, tmp_path: Path) -> None:
    path = tmp_path / "motor.yaml"
    path.write_text(MOTOR)
    model = load_model(path).with_effects(["coulomb_friction@motor"])
    records = []
    for pattern in ("*Sine_pi-2.npz", "*Chirp.npz"):
        run = source(data_dir / "dcmotor_fra233" / "npz", pattern)
        import_bag(run, tmp_path / run.stem, "dcmotor_fra233")
        records.append(read_record(tmp_path / run.stem, model).decimate(5))
    result = fit(model, records)
    assert result.model.values["coulomb_friction@motor.level"] > 5 * result.stderr[-1]
    for record in records:
        c = compare(result.model, record)
        error = np.linalg.norm(c.measured - c.simulated) / np.linalg.norm(c.measured)
        assert error < 0.06


def test_servo_with_pendulum_is_predicted(data_dir: Path, tmp_path: Path) -> None:
    path = tmp_path / "servo.yaml"
    path.write_text(PENDULUM)
    model = load_model(path)
    run = source(data_dir / "bam_servo_pendulum" / "xl330_raw", "*.json", 4)
    import_bag(run, tmp_path / run.stem, "bam")
    record = read_record(tmp_path / run.stem, model)
    result = fit(model, [record])
    assert np.all(np.isfinite(result.values))
    assert compare(result.model, record).fit_ahead["servo.position"] > 90.0
