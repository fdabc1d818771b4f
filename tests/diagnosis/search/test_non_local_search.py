"""Non-local searches: effects found from values that are far off, alone and together with a second one."""

from pathlib import Path

import numpy as np
import pytest

from idloop.diagnosis import refine
from idloop.diagnosis.search.non_local_search import non_local_searches
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model
from idloop.physics.effect import catalogue
from idloop.physics.simulation import simulate
from idloop.records import Record

OWN_EFFECTS = Path(__file__).parents[3] / "docs" / "examples" / "own_effect" / "effects"
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


@pytest.mark.slow
def test_an_effect_without_a_weak_form_is_found_far_from_the_fitted_values(start: Model) -> None:
    machine = start.with_values({"motor.viscous_friction": 9.0, "drive.gain": 25.0}).with_effects([BLIND])
    ladder = refine(start, [record_of(machine, 1)], [record_of(machine, 2)], criterion="simulation")
    assert ladder.added == (BLIND,)
    assert ladder.steps[-1].p_value is not None
    assert ladder.steps[-1].p_value < 1e-6
    assert ladder.model.values["drive.gain"] == pytest.approx(25.0, rel=0.02)
    assert ladder.model.values["motor.viscous_friction"] == pytest.approx(9.0, rel=0.02)


@pytest.mark.slow
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


TWO_BODIES = """
schema: idloop/model/1
name: two_bodies
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad, noise: 1.0e-4}
  - {topic: joint_states, joint: load, field: position, unit: rad, noise: 1.0e-4}
bodies:
  - {name: motor, inertia: {value: 0.01, min: 0.0}, viscous_friction: {value: 0.05, min: 0.0}}
  - {name: load, inertia: {value: 0.02, min: 0.0}, viscous_friction: {value: 0.02, min: 0.0}}
couplings:
  - {from: motor, to: load, stiffness: {value: 20.0, min: 0.0}, damping: {value: 0.02, min: 0.0}}
drive: {gain: 1.0}
"""


@pytest.mark.slow
def test_a_coupling_that_always_slips_is_found_although_it_resembles_a_damper(tmp_path: Path) -> None:
    path = tmp_path / "two_bodies.yaml"
    path.write_text(TWO_BODIES)
    model = load_model(path)
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 12.0, 0.005)
    command = np.repeat(rng.normal(size=60), 40)
    machine = model.with_effect("slip", "motor-load", limit=0.15)
    output = simulate(machine, time, command, time, noise=1e-4 * rng.normal(size=(len(time), 2))).output
    names, units = tuple(o.name for o in model.outputs), ("rad", "rad")
    record = Record("run", time, command, time, output, "motor.effort", "N·m", names, units)
    start = model.with_values({p.name: 0.8 * p.value for p in model.parameters if p.free})
    estimation = prepare_estimation(start, [record], "prediction")
    parent = refit(estimation, start)
    assert parent.model.values["motor-load.stiffness"] < 0.2 * start.values["motor-load.stiffness"]
    best = non_local_searches(estimation, parent, start)[0]
    assert best.proposal.name == "slip@motor-load"
    assert best.gain > 100.0
    assert best.fit.model.values["slip@motor-load.limit"] == pytest.approx(0.15, rel=1e-2)
    assert best.fit.model.values["motor-load.stiffness"] == pytest.approx(20.0, rel=1e-2)
