"""A free run begins where the machine was."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.estimation.dataset import prepare
from idloop.physics import Engine, Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.validation.free_run import free_run
from idloop.validation.measures import fit_percent


def recorded(machine: Model, seed: int, start: float = 0.0) -> Record:
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.005)
    command = 0.5 * rng.normal(size=81)[(4.0 * time).astype(int)]
    noise = rng.normal(size=(len(time), len(machine.outputs))) * [float(o.noise or 0.0) for o in machine.outputs]
    output = simulate(machine, time, command, time, noise=noise).output
    output[:, 0] += start
    names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
    return Record("run", time, command, time, output, machine.input.name, machine.input.unit, names, units)


def run(model: Model, record: Record) -> np.ndarray:
    return free_run(Engine(model), prepare(model, [record])[0])


@pytest.mark.parametrize("seed", range(4))
def test_an_inadequate_model_starts_where_the_machine_was(seed: int) -> None:
    plain = load_model("axis")
    record = recorded(plain.with_effects(["coulomb_friction@axis(level=0.15)", "load_torque@axis(torque=0.1)"]), seed)
    poor = plain.with_values({"axis.viscous_friction": 0.01})
    start = run(poor, record)[0]
    # The first readings are those of a machine at rest, and least squares would rather have it elsewhere.
    noise = np.array([float(o.noise or 0.0) for o in plain.outputs])
    assert np.all(np.abs(start - record.output[0]) < 10.0 * noise + 1e-9), start


@pytest.mark.parametrize("start", [0.0, -80.0])
def test_noise_of_the_first_reading_does_not_make_the_right_model_drift(start: float) -> None:
    model = load_model("axis")
    record = recorded(model, 5, start)
    assert np.min(fit_percent(record.output, run(model, record))) > 99.0


def test_a_sensor_with_an_effect_does_not_read_where_the_machine_was() -> None:
    model = load_model("axis").with_effects(["backlash@position[axis](gap=0.5)"])
    record = recorded(model, 5)
    assert np.min(fit_percent(record.output, run(model, record))) > 95.0
