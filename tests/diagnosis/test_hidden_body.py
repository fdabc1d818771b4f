"""A load behind a soft spring that nobody measures: the force balance cannot show it, and names what imitates it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import diagnose, refine
from idloop.physics import Model, load_model
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file
from idloop.physics.simulation import simulate
from idloop.records import Record

# As `idloop start` writes it: a command without a unit of force, so that the inertia is held.
ONE_BODY = """\
schema: idloop/model/1
name: link
input: {topic: command, joint: axis, field: effort, unit: V}
outputs:
  - {topic: states, joint: axis, field: position, unit: rad, noise: 0.002}
bodies:
  - {name: axis, inertia: 1.0, viscous_friction: {value: 20.0}}
drive: {gain: {value: 300.0}}
"""
SPRING = "compliance@axis"
EFFECTS = ["compliance", "presliding_friction", "coulomb_friction", "actuator_lag", "input_delay", "stribeck_friction"]
STIFFNESS = 160.0  # of a load that is two thirds of the inertia: a resonance at 4.2 Hz


def one_body() -> Model:
    return build_model(read_model_file(ONE_BODY, "link.yaml"), "link.yaml")


def link(kind: str) -> Record:
    time = np.arange(0.0, 12.0, 0.005)
    sweep = np.sin(2.0 * np.pi * (0.3 * time + 11.7 * time**2 / 24.0))
    command = sweep if kind == "sweep" else 0.5 * np.sign(np.sin(2.0 * np.pi * 0.4 * time))
    machine = one_body().with_values({"axis.viscous_friction": 12.0, "drive.gain": 150.0})
    machine = machine.with_effects([f"{SPRING}(stiffness={STIFFNESS}, damping=0.4, split=0.65)"])
    noise = 0.002 * np.random.default_rng(1).normal(size=(time.size, 1))
    output = simulate(machine, time, command, time, noise=noise).output
    return Record("run", time, command, time, output, "axis.effort", "V", ("axis.position",), ("rad",))


@pytest.mark.parametrize("kind", ["steps", "sweep"])
def test_a_load_behind_a_soft_spring_is_found(kind: str) -> None:
    ladder = refine(one_body(), [link(kind)], effects=EFFECTS)
    assert ladder.added == (SPRING,)
    assert ladder.model.values[f"{SPRING}.stiffness"] == pytest.approx(STIFFNESS, rel=0.01)
    assert ladder.model.values["drive.gain"] == pytest.approx(150.0, rel=0.01)


def motor(level: float, seed: int) -> tuple[Model, Record]:
    """A motor that drives a load through a spring, of which its own encoder alone is read, and the model to begin with.

    The resonance is at 28 Hz: one body leaves most of the force.
    """
    model = load_model("axis")
    position = tuple(replace(one, noise=3e-5) for one in model.outputs if one.field == "position")
    model = replace(model, outputs=position).with_values({"axis.inertia": 0.008, "axis.viscous_friction": 0.02})
    effects = ["compliance@axis(stiffness=60, damping=0.01, split=0.625)", f"coulomb_friction@axis(level={level})"]
    chance, time = np.random.default_rng(seed), np.arange(0.0, 8.0, 1e-3)
    sines = [np.sin(2.0 * np.pi * (f * time + chance.uniform())) for f in np.geomspace(0.2, 30.0, 25)]
    command = 0.17 * np.sum(sines, axis=0)
    noise = 3e-5 * chance.normal(size=(time.size, 1))
    output = simulate(model.with_effects(effects), time, command, time, noise=noise).output
    record = Record(str(seed), time, command, time, output, "axis.effort", "N·m", ("axis.position",), ("rad",))
    return model.with_values({one.name: 0.7 * one.value for one in model.parameters if one.free}), record


@pytest.mark.slow
def test_friction_at_a_motor_with_a_hidden_load_is_found_beside_the_spring() -> None:
    (start, train), (_, unseen) = (motor(0.15, seed) for seed in (1, 2))
    ladder = refine(start, [train], [unseen])
    assert ladder.added == (SPRING, "coulomb_friction@axis")
    values = ladder.model.values
    assert values["axis.inertia"] == pytest.approx(0.008, rel=0.01)
    assert values["compliance@axis.stiffness"] == pytest.approx(60.0, rel=0.01)
    assert values["coulomb_friction@axis.level"] == pytest.approx(0.15, rel=0.02)


def test_what_the_balance_names_and_makes_the_free_run_worse_is_asked_of_predictions() -> None:
    assert diagnose(one_body(), [link("steps")], effects=EFFECTS).set == (SPRING,)
