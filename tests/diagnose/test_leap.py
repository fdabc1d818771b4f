"""Effects without parameters: found from values that are far off, alone and together with a second one."""

from pathlib import Path

import numpy as np
import pytest

from idloop.diagnose import refine
from idloop.physics import Model, load_model
from idloop.physics.effect import catalogue
from idloop.physics.simulation import simulate
from idloop.records import Record

OWN_EFFECTS = Path(__file__).parents[2] / "docs" / "examples" / "own_effect" / "effects"
BLIND = "sign_blind_sensor@velocity[wheel]"
MODEL = """
schema: idloop/model/1
name: drive
input: {topic: joint_command, joint: wheel, field: effort, unit: V}
outputs:
  - {topic: joint_states, joint: wheel, field: velocity, unit: rad/s}
bodies:
  - {name: motor, inertia: 1.0, viscous_friction: {value: 1.0, min: 0.0}}
  - {name: wheel, inertia: 1.0, viscous_friction: 0.0}
couplings:
  - {from: motor, to: wheel, stiffness: 1.0e+4, damping: 10.0}
drive: {gain: {value: 1.0, min: 0.0}}
effects: []
"""


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Model:
    """A stiff drive with nothing known about it but its inertia."""
    monkeypatch.setenv("IDLOOP_EFFECTS", str(OWN_EFFECTS))
    path = tmp_path / "drive.yaml"
    path.write_text(MODEL)
    return load_model(path)


def record_of(machine: Model, seed: int, seconds: float = 6.0) -> Record:
    """Random steps of one size and two signs."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.02)
    command = rng.choice([-1.0, 1.0], size=int(5 * seconds) + 1)[(5 * time).astype(int)]
    noise = 0.02 * rng.normal(size=(len(time), 1))
    output = simulate(machine, time, command, time, noise=noise).output
    return Record(f"run{seed}", time, command, time, output, "wheel.effort", "V", ("wheel.velocity",), ("rad/s",))


def test_an_effect_without_a_weak_form_is_found_where_its_own_fit_is_far_away(start: Model) -> None:
    machine = start.with_values({"motor.viscous_friction": 9.0, "drive.gain": 25.0}).with_effects([BLIND])
    ladder = refine(start, [record_of(machine, 1)], [record_of(machine, 2)], criterion="simulation")
    assert ladder.added == (BLIND,)
    assert ladder.steps[-1].p_value is not None
    assert ladder.steps[-1].p_value < 1e-6
    assert ladder.model.values["drive.gain"] == pytest.approx(25.0, rel=0.02)
    assert ladder.model.values["motor.viscous_friction"] == pytest.approx(9.0, rel=0.02)


def test_an_effect_that_shows_only_together_with_a_second_one_is_found_with_it(start: Model) -> None:
    hidden = "compliance@motor(stiffness=150.0,damping=0.5,split=0.3)"
    machine = start.with_values({"motor.viscous_friction": 6.0, "drive.gain": 18.0}).with_effects([BLIND, hidden])
    ladder = refine(start, [record_of(machine, 3)], [record_of(machine, 4)], criterion="simulation", most=2)
    assert ladder.added == (BLIND, "compliance@motor")
    assert ladder.steps[-1].validation["nrmse"]["wheel.velocity"] < 0.1


def test_no_built_in_effect_is_without_parameters() -> None:
    assert all(effect.parameters for effects in catalogue().values() for effect in effects)


def test_what_is_not_there_is_not_found(start: Model) -> None:
    machine = start.with_values({"motor.viscous_friction": 9.0, "drive.gain": 25.0})
    ladder = refine(start, [record_of(machine, 5)], criterion="simulation")
    assert ladder.added == ()
